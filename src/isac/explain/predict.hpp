/// @file
/// The residual of a whole dataset for a model: baseline, tolerances and any effects of the catalogue.
///
///   torque      T_read = S[ T(φ, φ̇, p1, p2) ]                       every run with forces
///   pressure    p_read = S[ p(t) ],  T_C ṗ = K_C u − p              every run with commands, simulated from them
///   motion      T_read = S[ I φ̈ − T_joint ]                         runs in which the joint moves freely
///
/// S is what sensors do to a reading. Effects on readings of angle and pressure are undone in the measured signal before it
/// enters an equation; those on forces and pressures that are predicted are done to the prediction. Effects with states are
/// integrated along the measured motion. At its null value every effect leaves every row bit for bit.
/// Rows are low-passed with the kernel of their chain; weights are the caller's.
/// Units: SI. Threads: const members may be called from many threads at once. Errors: none; NaN where a model breaks down.
/// Source: docs/derivations/explain.md.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "isac/explain/hypothesis.hpp"
#include "isac/explain/prepared.hpp"

namespace isac::explain {

/// The baseline's parameters: terms of the output first, then K_C and T_C where the valve unit is in the data.
struct BaseParameter {
  std::string name, unit;
  double si_per_unit = 1;
  double start = 0, lower = 0, upper = 0;
  unsigned chains = 0;
};

struct ModelPoint {
  std::vector<double> base;
  std::vector<Active> effects;  ///< tolerances among them
  /// Of each run in which the joint rests: where between two steps of the encoder it stands, rad. Empty: none.
  std::vector<double> rest;
};

/// Is a force's reading clipped? Then rows of the torque are not linear in the baseline.
[[nodiscard]] bool clips_force(const ModelPoint& model) noexcept;

class Predictor {
 public:
  /// `threads`: that one prediction of all runs may use.
  explicit Predictor(const Prepared& data, int threads = 1);

  [[nodiscard]] const std::vector<BaseParameter>& base() const noexcept { return base_; }
  [[nodiscard]] const Prepared& data() const noexcept { return *data_; }
  [[nodiscard]] std::size_t rows() const noexcept { return data_->rows.size(); }
  [[nodiscard]] int threads() const noexcept { return threads_; }
  /// Runs whose angle stays within two steps of the encoder.
  [[nodiscard]] const std::vector<std::size_t>& resting_runs() const noexcept { return resting_; }
  /// Torque per radian of the baseline: what an angle within a step is worth.
  [[nodiscard]] double stiffness(const ModelPoint& model) const noexcept;
  /// Torque per pressure difference, N m/Pa, of the baseline.
  [[nodiscard]] double pressure_gain(const ModelPoint& model) const noexcept;
  /// K_C, and T_C in s.
  [[nodiscard]] double valve_gain(const ModelPoint& model) const noexcept;
  [[nodiscard]] double valve_lag(const ModelPoint& model) const noexcept;
  /// What was measured, low-passed: the residual's other half.
  [[nodiscard]] const Eigen::VectorXd& measured() const noexcept { return measured_; }
  /// Predictions of the rows of one run that belong to the chains asked for; other rows of `out` stay as they are.
  void predict_run(const ModelPoint& model, std::size_t run, unsigned chains, Eigen::VectorXd& out) const;
  void predict(const ModelPoint& model, unsigned chains, Eigen::VectorXd& out) const;
  /// Does the effect only add a torque of its own, which no sensor of the force reads by another measure?
  [[nodiscard]] bool adds_up(const ModelPoint& model, const Hypothesis& effect) const noexcept;
  /// What such an effect adds to the rows of its chains; other rows of `out` stay as they are.
  void predict_addition(const ModelPoint& model, const Active& effect, Eigen::VectorXd& out) const;
  /// The prediction at the recording's rate, for pictures and for floors: torque (and pressures) of one run.
  struct FullRate {
    std::vector<double> torque, pressure[2], motion;
  };
  [[nodiscard]] FullRate full_rate(const ModelPoint& model, std::size_t run) const;

 private:
  struct Motions;
  struct Inputs;
  struct Columns;
  std::shared_ptr<const Motions> motions_of(const ModelPoint& model, std::size_t run) const;
  std::shared_ptr<const Motions> make_motions(const ModelPoint& model, std::size_t run) const;
  std::shared_ptr<const Inputs> inputs_of(const ModelPoint& model, std::size_t run) const;
  std::shared_ptr<const Inputs> make_inputs(const ModelPoint& model, std::size_t run) const;
  void undo_angle_readings(const ModelPoint& model, std::size_t run, Motions& in) const;
  void add_columns(std::size_t run, Inputs& in) const;
  /// Of some of the model's effects, at every sample; empty where none enters.
  std::vector<double> torque_of_effects(const ModelPoint& model, std::span<const Active> effects,
                                        const PreparedRun& run, const Inputs& in, bool motion) const;
  /// Is it a torque that the rows of this chain have in them?
  bool enters(const Hypothesis& effect, bool motion) const noexcept;
  auto points_of(const ModelPoint& model, const Hypothesis& effect, const PreparedRun& run,
                 const Inputs& in) const;
  /// Of a driven axis what acts on it is what its drive need not do.
  double sign_of_torque() const noexcept { return data_->baseline.driven ? -1.0 : 1.0; }
  /// Adds the effect's torque at every sample.
  void add_torque(const ModelPoint& model, const Active& a, const PreparedRun& run, const Inputs& in,
                  std::vector<double>& sum) const;
  /// The same with 1 for one amplitude and 0 for the others, for each of them; at one sample of `every` where it has no states.
  std::vector<std::vector<double>> torques_of_amplitudes(const ModelPoint& model, const Active& a,
                                                         const PreparedRun& run, const Inputs& in,
                                                         std::size_t every) const;
  std::size_t thinned(const Hypothesis& effect, double sigma) const noexcept;
  /// Can its rows be had from columns? Not where it bends, or where states are read off the data.
  bool has_columns(const Hypothesis& effect, bool motion) const noexcept;
  std::shared_ptr<const Columns> columns_of(const ModelPoint& model, const Active& a, std::size_t run,
                                            const Inputs& in, bool motion) const;
  /// What the effects that have columns add to the run's rows of one chain, one value for each, and the effects that have none.
  std::vector<Active> without_columns(const ModelPoint& model, std::size_t run, const Inputs& in, bool motion,
                                      std::vector<double>& rows) const;
  /// Adds the baseline's own torque, at every sample.
  void add_base_torque(const ModelPoint& model, const Inputs& in, std::vector<double>& sum) const;
  void pressures_of(const ModelPoint& model, const PreparedRun& run, const Inputs& in,
                    std::vector<double> (&p)[2]) const;
  enum class Reading { kSmooth, kClipped };
  void read_forces(const ModelPoint& model, const PreparedRun& run, Reading which,
                   const std::vector<double>& torque, std::vector<double>& change) const;
  /// Of one sample, where no sensor has a memory or is clipped.
  double change_at(const ModelPoint& model, const PreparedRun& run, std::size_t k, double torque) const;

  const Prepared* data_;
  int threads_ = 1;
  std::uint64_t identity_ = 0;  ///< of this predictor among all, for what a thread keeps
  std::vector<BaseParameter> base_;
  std::vector<int> terms_;         ///< catalogue indices of the output's terms
  std::vector<double> term_sign_;  ///< −1 for a driven axis
  int gain_ = -1, lag_ = -1;       ///< positions of K_C, T_C in base
  int stiffness_ = -1, pressure_gain_ = -1, cubic_damping_ = -1, damping_ = -1;
  Eigen::VectorXd measured_;
  std::vector<std::size_t> resting_;
};

}  // namespace isac::explain
