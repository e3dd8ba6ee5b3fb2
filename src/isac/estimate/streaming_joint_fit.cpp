#include "isac/estimate/streaming_joint_fit.hpp"

#include <utility>

#include "isac/estimate/streaming_state.hpp"

namespace isac::estimate {

StreamingJointFit::StreamingJointFit(const JointFitOptions& options, std::size_t pilot_rows)
    : state_(std::make_unique<State>(options, pilot_rows)) {}
StreamingJointFit::~StreamingJointFit() = default;
StreamingJointFit::StreamingJointFit(StreamingJointFit&&) noexcept = default;
StreamingJointFit& StreamingJointFit::operator=(StreamingJointFit&&) noexcept = default;

void StreamingJointFit::learn(std::vector<JointRun> runs) {
  state_->waiting = std::move(runs);
  state_->make_pilot();
  state_->waiting.clear();
}

bool StreamingJointFit::knows_all_terms() const {
  return state_->pilot.rank.kept.size() == state_->terms.linear().size();
}

void StreamingJointFit::add(const JointRun& block) {
  State& s = *state_;
  if (s.ready) {
    s.consume(block);
    return;
  }
  if (s.waiting.empty() || s.waiting.back().name != block.name) {
    s.waiting.push_back({});
    s.waiting.back().name = block.name;
  }
  append_rows(s.waiting.back(), block);
  s.waiting_rows += block.time.size();
  if (s.waiting_rows < s.pilot_rows) return;
  s.make_pilot();
  s.take_waiting();
}

StreamingJointFit StreamingJointFit::fork() const {
  StreamingJointFit out(state_->options, state_->pilot_rows);
  State& to = *out.state_;
  const State& from = *state_;
  to.stated = from.stated;
  to.pilot = from.pilot;
  to.start = from.start;
  to.zero = from.zero;
  to.pilot_interval = from.pilot_interval;
  to.loss = from.loss;
  to.base = from.base;
  to.block_rows = from.block_rows;
  to.plain_gram = Eigen::MatrixXd::Zero(from.plain_gram.rows(), from.plain_gram.cols());
  to.plain_moment = Eigen::VectorXd::Zero(from.plain_moment.size());
  to.clear_sample();
  to.ready = from.ready;
  return out;
}

void StreamingJointFit::merge(StreamingJointFit& other) {
  State& s = *state_;
  State& o = *other.state_;
  s.open = false;
  for (OpenBlock& block : o.blocks) block.run += s.ranges.size();
  s.blocks.insert(s.blocks.end(), o.blocks.begin(), o.blocks.end());
  s.ranges.insert(s.ranges.end(), o.ranges.begin(), o.ranges.end());
  s.plain_gram += o.plain_gram;
  s.plain_moment += o.plain_moment;
  s.plain_square += o.plain_square;
  s.rows += o.rows;
  s.outliers += o.outliers;
  s.seen += o.seen;
  s.keep_sample(o.sample);
}

}  // namespace isac::estimate
