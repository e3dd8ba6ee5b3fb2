/// @file
/// What may be hidden in a dataset: every coefficient beyond the base model, zero when it is off. Written from the
/// table of effects alone; the reading of each line of it stands beside the field.
#pragma once

#include <cstdint>

namespace blind {

struct Hidden {
  // In the muscles: the force sensors see it.
  double linear_damping = 0, cubic_damping = 0;                       ///< −D φ̇; −C φ̇³
  double torque_offset = 0, asymmetry = 0;                            ///< T0; b r p_mean, b in N cm2/kg
  double coulomb = 0;                                                 ///< −T_c sgn φ̇
  double stribeck_slide = 0, stribeck_extra = 0, stribeck_speed = 1;  ///< T_c, T_s − T_c, v_s
  double loaded = 0, loaded_power = 1;                                ///< −T_c (p_mean/p0)^n sgn φ̇
  double hysteresis = 0, hysteresis_reach = 1;  ///< T_h, φ_s; dz/dφ = (1 − z sgn φ̇)/φ_s
  double asym_up = 0, asym_down = 0, asym_reach_up = 1,
         asym_reach_down = 1;                    ///< the force goes to +up or to −down
  double creep = 0, creep_time = 1;              ///< −k (φ − c), ċ = (φ − c)/τ, c(0) = φ(0)
  double warm_A = 0, warm_B = 0, warm_time = 1;  ///< A, B times 1 + w (1 − e^(−t/τ)), t since the first run
  double cubic_stiffness = 0;                    ///< −k3 φ³
  double mean_stiffness = 0;                     ///< α A r² φ (p_mean/p0 − 1)
  double quadratic = 0;                          ///< a′ Δp r³ φ², a′ in N cm2/(kg m2)
  double slack_share = 0, slack_angle = 1;       ///< −share A r² (|φ| − φ_s)₊ sgn φ
  double lever = 0;                              ///< r(φ) = r (1 + a φ²) in A r² φ and in B r Δp
  double ripple = 0, ripple_teeth = 1, ripple_phase = 0;  ///< a sin(N φ + ψ)
  double mean_damping = 0;                                ///< −D1 φ̇ (p_mean − p0)
  double cubic_pressure = 0;                              ///< b3 Δp³
  double threshold = 0;                                   ///< each muscle pulls by max(0, p − p_th)
  double periodic = 0, periodic_frequency = 1, periodic_phase = 0;  ///< a sin(2π f t + ψ), t of the day

  // On the joint: only a free joint shows it.
  double gravity = 0, gravity_angle = 0;      ///< −m g l sin(φ + φ0)
  double bearing = 0;                         ///< −T_b sgn φ̇
  double added_inertia = 0;                   ///< −ΔI φ̈
  double quadratic_damping = 0;               ///< −c φ̇ |φ̇|
  double stop_stiffness = 0, stop_angle = 1;  ///< −k (|φ| − φ_e)₊ sgn φ
  int stop_side = 0;                          ///< 0 both, +1 or −1 only one
  double compliance = 0, second_share = 0.5,
         second_damping = 0.05;  ///< 1/k; part of I behind the spring; ratio
  double play = 0;               ///< the wheel follows the joint with a play of ±this

  // In the valve units.
  double dead_time = 0, second_lag = 0;  ///< s; another 1/(1 + T2 s) before the first
  double vent_ratio = 0;                 ///< T_C (1 + this) when the pressure falls
  double slowness = 0;                   ///< |ṗ| ≤ 1/this
  double deadband = 0;                   ///< ṗ = 0 while |K_C p_cmd − p| < this
  double droop = 0, droop_time = 1;      ///< target (1 − droop q), q the filtered filling of both
  double pump = 0;                       ///< ṗ1 −= κ φ̇, ṗ2 += κ φ̇ (κ either sign)
  double valve_offset = 0;               ///< p = K_C p_cmd + b, both valves
  double leak_1 = 0, leak_2 = 0;         ///< ṗ −= this p, 1/s
  double valve_play = 0;                 ///< ± this on the command
  double crosstalk = 0;                  ///< p1 += x p2

  // In the sensors.
  double force_offset_1 = 0, force_offset_2 = 0, force_gain_1 = 0, force_gain_2 = 0;
  double force_drift_1 = 0, force_drift_2 = 0;  ///< N/s since the first run
  double clip = 0;                              ///< N; forces above are read as this; 0 is off
  double pressure_offset_1 = 0, pressure_offset_2 = 0, pressure_gain_1 = 0, pressure_gain_2 = 0;
  double encoder_offset = 0, encoder_gain = 0, encoder_drift = 0;  ///< rad, 1, rad/s since the first run
  double slip = 0, slip_time = 0;                                  ///< rad from this time of the day on
  double encoder_play = 0;             ///< the reading follows with a play of ±this
  double force_lag = 0, skew = 0;      ///< s
  double spikes = 0, spike_share = 0;  ///< N; share of rows with one
  double hum = 0, hum_frequency = 50, hum_phase_1 = 0, hum_phase_2 = 0;  ///< N, Hz

  // Not in the catalogue.
  double angle_friction = 0;                ///< −T_c |φ| sgn φ̇
  double root_damping = 0;                  ///< −d |φ̇|^½ sgn φ̇
  double odd_pressure_angle = 0;            ///< g r Δp |φ| φ: sign-odd second order
  double angle_damping = 0;                 ///< −d φ̇ φ²
  double maxwell = 0, maxwell_time = 1;     ///< −s, ṡ = k φ̇ − s/τ: a loop that depends on the rate
  double heat_friction = 0, heat_time = 1;  ///< −T h sgn φ̇, ḣ = (|φ̇| − h)/τ
  double sticking = 0, sticking_share = 0, sticking_window = 1;  ///< friction in some windows of time only
  double bent_gain = 0, bent_pressure = 0;  ///< muscle 2 gains 1 − this above this pressure
  double wear = 0, wear_time = 0;           ///< A (1 − this) from this time of the day on
  double hunting = 0, hunting_frequency = 1, hunting_phase = 0;  ///< both valves swing by themselves
  double step_stiffness = 0, step_from = 0, step_to = 1;         ///< −k (clamp(φ, from, to) − from)

  std::uint64_t seed = 0;  ///< of what comes at random times (spikes, sticking)

  bool operator==(const Hidden&) const = default;
};

/// `hidden` without what move_rig cannot show in a run: the sensors' part, and in a run that is led by hand what acts on
/// the joint. Two that are equal here move the rig alike.
Hidden moving_part(const Hidden& hidden, bool free);
/// Nothing of `hidden` is in the sensors (but for the lag of the forces, which move_rig has).
bool sensors_are_true(const Hidden& hidden);

}  // namespace blind
