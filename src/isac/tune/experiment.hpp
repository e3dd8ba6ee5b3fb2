/// @file
/// Experiments that tune: pure step objects. One angle in, one Δp out, every tick; what joins them to a card stands outside.
///
///   settle    Δp stands at its centre; mean and scatter of the angle are measured
///   excite    the experiment's own (relay.hpp, gain_ramp.hpp, step_series.hpp)
///   done or failed, with the reason in one sentence
/// Every command stays within centre ± reach, whatever the experiment does. Each tick is kept in `record()`.
///
/// Units: SI; time in seconds since the first tick. Real time: step() is constant time, no heap after construction, noexcept.
/// Threads: one. Errors: an angle or time that is not finite, or time that stands still, fails the experiment.
/// Example: `while (!relay.finished()) command = relay.step(time, angle);`
#pragma once

#include <cstddef>
#include <string>
#include <vector>

namespace isac::tune {

struct ExperimentRecord {
  std::vector<double> time;     ///< s
  std::vector<double> command;  ///< Pa, Δp from this tick on
  std::vector<double> angle;    ///< rad
};

struct ExperimentSettings {
  double centre = 0;        ///< Pa, Δp about which all happens
  double reach = 0;         ///< Pa, |Δp − centre| at most
  double settle = 1.0;      ///< s
  double longest = 60.0;    ///< s, of the whole; then it fails
  double interval = 0.001;  ///< s, between ticks, as far as is known: sizes the record
};

class Experiment {
 public:
  explicit Experiment(const ExperimentSettings& settings);
  virtual ~Experiment() = default;
  Experiment(const Experiment&) = delete;
  Experiment& operator=(const Experiment&) = delete;

  /// Δp to command from now on, Pa.
  double step(double time, double angle) noexcept;

  enum class State { kSettle, kExcite, kDone, kFailed };
  [[nodiscard]] State state() const noexcept { return state_; }
  [[nodiscard]] bool finished() const noexcept { return state_ == State::kDone || state_ == State::kFailed; }
  /// Why it failed; empty otherwise.
  [[nodiscard]] const char* failure() const noexcept { return failure_; }
  [[nodiscard]] const ExperimentRecord& record() const noexcept { return record_; }
  /// The record from a little before the excitation began: at rest, command at the centre.
  [[nodiscard]] ExperimentRecord excited() const;
  [[nodiscard]] double rest_angle() const noexcept { return rest_angle_; }
  [[nodiscard]] double noise() const noexcept { return noise_; }  ///< rad, standard deviation while settling
  [[nodiscard]] const ExperimentSettings& settings() const noexcept { return settings_; }

 protected:
  /// Δp − centre, from the time since the excitation began and the angle less its rest.
  virtual double excite(double time, double angle) noexcept = 0;
  void finish() noexcept { state_ = State::kDone; }
  void fail(const char* why) noexcept {
    state_ = State::kFailed;
    failure_ = why;
  }

 private:
  void settle(double time, double angle) noexcept;

  ExperimentSettings settings_;
  ExperimentRecord record_;
  State state_ = State::kSettle;
  const char* failure_ = "";
  double first_time_ = 0, last_time_ = 0, excite_from_ = 0, last_command_;
  std::size_t excite_row_ = 0;
  double sum_ = 0, squares_ = 0, shift_ = 0, count_ = 0, rest_angle_ = 0, noise_ = 0;
};

}  // namespace isac::tune
