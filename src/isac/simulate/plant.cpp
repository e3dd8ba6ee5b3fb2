#include "isac/simulate/plant.hpp"

#include <algorithm>
#include <boost/numeric/odeint/algebra/array_algebra.hpp>
#include <boost/numeric/odeint/stepper/controlled_runge_kutta.hpp>
#include <boost/numeric/odeint/stepper/dense_output_runge_kutta.hpp>
#include <boost/numeric/odeint/stepper/generation/generation_controlled_runge_kutta.hpp>
#include <boost/numeric/odeint/stepper/generation/generation_dense_output_runge_kutta.hpp>
#include <boost/numeric/odeint/stepper/generation/generation_runge_kutta_dopri5.hpp>
#include <boost/numeric/odeint/stepper/generation/make_dense_output.hpp>
#include <boost/numeric/odeint/stepper/runge_kutta_dopri5.hpp>
#include <cmath>
#include <exception>
#include <limits>
#include <vector>

#include "isac/simulate/joint_physics.hpp"

namespace isac::simulate {

namespace {

namespace odeint = boost::numeric::odeint;

// Pressures in kgf/cm² so that all components are of order one and share one absolute tolerance.
using State = std::array<double, kPlantStates>;
using Dopri5 = odeint::runge_kutta_dopri5<State, double, State, double, odeint::array_algebra>;
using Stepper = odeint::result_of::make_dense_output<Dopri5>::type;

constexpr double kLongestStep = 0.01;  // s: finer than a tremor, shorter than the hand's plan
constexpr double kFirstStep = 1e-3;    // s
constexpr double kNever = std::numeric_limits<double>::infinity();
constexpr double kPerKgfCm2 = kPascalPerKgfCm2;

enum class Event : std::uint8_t { kNone, kReversal, kStop, kBreakaway };

/// Changes of a valve's command on their way through the tube, first in, first out.
class Tube {
 public:
  Tube() : edges_(kCapacity) {}
  [[nodiscard]] double next() const noexcept { return count_ > 0 ? edges_[head_].time : kNever; }
  void push(double time, double pressure) noexcept {
    if (count_ < kCapacity) ++count_;  // else the newest is replaced
    edges_[(head_ + count_ - 1) % kCapacity] = {time, pressure};
  }
  double pop() noexcept {
    const double pressure = edges_[head_].pressure;
    head_ = (head_ + 1) % kCapacity;
    --count_;
    return pressure;
  }

 private:
  static constexpr std::size_t kCapacity = 4096;
  struct Edge {
    double time = 0, pressure = 0;
  };
  std::vector<Edge> edges_;
  std::size_t head_ = 0, count_ = 0;
};

}  // namespace

class Plant::Impl {
 public:
  explicit Impl(const RigConfig& config)
      : config_(config),
        physics_(config),
        stepper_(odeint::make_dense_output(0.1 * config.relative_tolerance, config.relative_tolerance,
                                           kLongestStep, Dopri5())) {
    x_ = physics_.initial_state(config);
    for (std::size_t i = 0; i < 2; ++i) {
      commanded_[i] = config.pressure[i];
      acting_[i] = config.pressure[i];
    }
    settle_side();
  }

  void command(const std::array<double, 2>& pressure) noexcept {
    for (std::size_t i = 0; i < 2; ++i) {
      if (pressure[i] == commanded_[i]) continue;
      commanded_[i] = pressure[i];
      tubes_[i].push(time_ + physics_.dead_time(i), pressure[i]);
    }
    apply_edges();
  }

  void hold(Hand* hand) noexcept {
    hand_ = hand;
    stuck_ = false;
    fresh_ = true;
    settle_side();
  }

  Status step_to(double limit) noexcept {
    apply_edges();
    double end = std::min({limit, tubes_[0].next(), tubes_[1].next()});
    if (end <= time_) return Status::kOk;
    if (fresh_ || stepper_.current_time() <= time_) {
      if (!try_step()) return Status::kDeviceError;
    }
    end = std::min({end, stepper_.current_time(), event_time_});
    const bool at_event = end == event_time_;
    stepper_.calc_state(end, x_);
    time_ = end;
    if (hand_ != nullptr) follow_hand();
    if (!std::isfinite(x_[kPhi]) || !std::isfinite(x_[kOmega])) return Status::kDeviceError;
    if (at_event) handle_event();
    return Status::kOk;
  }

  PlantState state() const noexcept {
    PlantState s;
    s.time = time_;
    s.pressure = physics_.pressures(x_);
    s.joint = {.angle = x_[kPhi], .velocity = x_[kOmega]};
    const Torques torques = physics_.torques(point_at(time_, x_));
    s.torque = torques.muscle;
    s.driving_torque = torques.muscle + torques.joint;
    if (hand_ != nullptr) {
      s.joint.acceleration = hand_->at(time_).acceleration;
    } else if (stuck_) {
      s.torque = stuck_muscle_torque();
      s.driving_torque = 0;
    } else {
      s.joint.acceleration = s.driving_torque / physics_.inertia();
    }
    s.force = physics_.forces(s.torque, s.pressure);
    return s;
  }

  double time() const noexcept { return time_; }
  const std::array<double, 2>& commanded() const noexcept { return commanded_; }
  bool stuck() const noexcept { return stuck_; }

 private:
  void apply_edges() noexcept {
    bool arrived = false;
    for (std::size_t i = 0; i < 2; ++i) {
      while (tubes_[i].next() <= time_) {
        acting_[i] = tubes_[i].pop();
        arrived = true;
      }
    }
    if (!arrived) return;
    physics_.step_valves(acting_, x_);
    fresh_ = true;
  }

  bool try_step() noexcept try {
    if (hand_ != nullptr) hand_->forget_before(time_);
    if (fresh_) stepper_.initialize(x_, time_, kFirstStep);
    fresh_ = false;
    stepper_.do_step([this](const State& x, State& dxdt, double t) { derivative(x, dxdt, t); });
    find_event();
    return true;
  } catch (const std::exception&) {  // the step cannot be made small enough
    return false;
  }

  /// Speed as the friction sees it: kept on the side of zero on which the step began, so that the step is smooth.
  double one_sided(double omega) const noexcept {
    if (hand_ != nullptr || !physics_.dry_friction()) return omega;
    return side_ > 0 ? std::max(omega, kBarelyMoving) : std::min(omega, -kBarelyMoving);
  }

  StatePoint point_at(double t, const State& x) const noexcept {
    return {.time = t, .x = x, .omega = one_sided(x[kOmega]), .touch = touch_, .held = hand_ != nullptr};
  }

  void derivative(const State& x, State& dxdt, double t) noexcept {
    State y = x;
    if (hand_ != nullptr) {
      const Motion m = hand_->at(t);
      y[kPhi] = m.angle;
      y[kOmega] = m.velocity;
    } else if (stuck_) {
      y[kOmega] = 0;
    }
    StatePoint point = point_at(t, y);
    if (stuck_) point.omega = 0;
    physics_.rates(point, acting_, dxdt);
    if (hand_ != nullptr || stuck_) return;
    const Torques torques = physics_.torques(point);
    dxdt[kPhi] = y[kOmega];
    dxdt[kOmega] = (torques.muscle + torques.joint) / physics_.inertia();  // eq 4.3
  }

  void follow_hand() noexcept {
    const Motion m = hand_->at(time_);
    x_[kPhi] = m.angle;
    x_[kOmega] = m.velocity;
  }

  Event violated(const State& x, double t) const noexcept {
    if (hand_ != nullptr) return Event::kNone;
    if (stuck_) return leaves(x, t) != 0 ? Event::kBreakaway : Event::kNone;
    if (physics_.dry_friction() && x[kOmega] * side_ < 0) return Event::kReversal;
    if (physics_.touching(x[kPhi]) != touch_) return Event::kStop;
    return Event::kNone;
  }

  /// Filippov at φ̇ = 0: +1 or −1 if the torque just beside zero speed leads away from it, 0 if it leads back from both.
  int leaves(const State& x, double t) const noexcept {
    StatePoint point{.time = t, .x = x, .omega = kBarelyMoving, .touch = touch_, .held = false};
    const Torques above = physics_.torques(point);
    if (above.muscle + above.joint > 0) return 1;
    point.omega = -kBarelyMoving;
    const Torques below = physics_.torques(point);
    return below.muscle + below.joint < 0 ? -1 : 0;
  }

  /// At rest the frictions of muscles and joint share what holds the joint in proportion to their limits.
  double stuck_muscle_torque() const noexcept {
    StatePoint point{.time = time_, .x = x_, .omega = kBarelyMoving, .touch = touch_, .held = false};
    const Torques above = physics_.torques(point);
    point.omega = -kBarelyMoving;
    const Torques below = physics_.torques(point);
    const double sum_above = above.muscle + above.joint, sum_below = below.muscle + below.joint;
    const double share = sum_below / (sum_below - sum_above);  // 0 … 1, so that the sum is zero
    return below.muscle + share * (above.muscle - below.muscle);
  }

  void find_event() noexcept {
    event_time_ = kNever;
    event_ = Event::kNone;
    const double begin = time_, end = stepper_.current_time();
    State x;
    double low = begin, high = begin;
    for (const double t : {0.5 * (begin + end), end}) {
      stepper_.calc_state(t, x);
      event_ = violated(x, t);
      low = high;
      high = t;
      if (event_ != Event::kNone) break;
    }
    if (event_ == Event::kNone) return;
    for (int k = 0; k < 60 && high - low > 1e-12; ++k) {
      const double middle = 0.5 * (low + high);
      stepper_.calc_state(middle, x);
      const Event there = violated(x, middle);
      if (there == Event::kNone) {
        low = middle;
      } else {
        high = middle;
        event_ = there;
      }
    }
    event_time_ = high;
  }

  void handle_event() noexcept {
    fresh_ = true;
    event_time_ = kNever;
    if (event_ == Event::kStop) {
      touch_ = physics_.touching(x_[kPhi]);
      return;
    }
    x_[kOmega] = 0;
    settle_side();
  }

  /// After anything that may change on which side of zero the speed lies.
  void settle_side() noexcept {
    if (hand_ != nullptr) return;
    touch_ = physics_.touching(x_[kPhi]);
    if (!physics_.dry_friction()) return;
    if (x_[kOmega] != 0) {
      side_ = x_[kOmega] > 0 ? 1 : -1;
      return;
    }
    const int direction = leaves(x_, time_);
    stuck_ = direction == 0;
    if (direction != 0) side_ = direction;
  }

  RigConfig config_;
  JointPhysics physics_;
  Stepper stepper_;
  State x_{};
  double time_ = 0;
  bool fresh_ = true;
  Hand* hand_ = nullptr;
  bool stuck_ = false;
  int side_ = 1;
  int touch_ = 0;
  double event_time_ = kNever;
  Event event_ = Event::kNone;
  std::array<double, 2> commanded_{}, acting_{};
  std::array<Tube, 2> tubes_;
};

Plant::Plant(const RigConfig& config) : impl_(std::make_unique<Impl>(config)) {}
Plant::~Plant() = default;
Plant::Plant(Plant&&) noexcept = default;
Plant& Plant::operator=(Plant&&) noexcept = default;

void Plant::command(const std::array<double, 2>& pressure) noexcept {
  impl_->command(pressure);
}
const std::array<double, 2>& Plant::commanded() const noexcept {
  return impl_->commanded();
}
void Plant::hold(Hand* hand) noexcept {
  impl_->hold(hand);
}
Status Plant::step_to(double limit) noexcept {
  return impl_->step_to(limit);
}
double Plant::time() const noexcept {
  return impl_->time();
}
PlantState Plant::state() const noexcept {
  return impl_->state();
}
bool Plant::stuck() const noexcept {
  return impl_->stuck();
}

}  // namespace isac::simulate
