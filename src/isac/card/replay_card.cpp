#include "isac/card/replay_card.hpp"

#include <algorithm>
#include <cmath>
#include <optional>
#include <string>

#include "isac/card/calibration.hpp"
#include "isac/core/error.hpp"
#include "isac/record/csv_reader.hpp"

namespace isac::card {

namespace {

/// A channel's column and how its values become codes: code = value/gain + offset.
struct Source {
  const series::Column* column = nullptr;
  double offset = 0, gain = 1;
};

std::optional<Source> find_source(const series::Recording& recording, const std::string& channel,
                                  const std::vector<record::RigChannel>& calibration) {
  if (const auto* raw = recording.find(channel)) return Source{.column = raw};
  for (const auto& c : calibration) {
    if (c.channel != channel) continue;
    if (const auto* physical = recording.find(c.signal)) return Source{physical, c.offset, c.gain};
  }
  return std::nullopt;
}

std::uint32_t wrapped(double code, std::uint32_t modulus) noexcept {
  const double turns = std::floor(code / static_cast<double>(modulus));
  return static_cast<std::uint32_t>(code - turns * static_cast<double>(modulus));
}

std::uint32_t clamped(double code, std::uint32_t max) noexcept {
  return static_cast<std::uint32_t>(std::clamp(code, 0.0, static_cast<double>(max)));
}

/// Calls take(row, code) for every row, missing samples repeated (or left out where `repeat` is false).
template <typename Take>
void each_code(const Source& source, bool repeat, Take take) {
  const auto& values = source.column->values;
  const auto first = std::find_if(values.begin(), values.end(), [](double v) { return std::isfinite(v); });
  double last = first == values.end() ? 0 : *first;
  for (std::size_t k = 0; k < values.size(); ++k) {
    if (std::isfinite(values[k])) last = values[k];
    if (repeat || std::isfinite(values[k])) take(k, std::round(last / source.gain + source.offset));
  }
}

std::int64_t quarter_of_median_period(const std::vector<Sample>& samples) {
  if (samples.size() < 2) return 0;
  std::vector<std::int64_t> steps(samples.size() - 1);
  for (std::size_t k = 0; k < steps.size(); ++k) steps[k] = samples[k + 1].time_ns - samples[k].time_ns;
  const auto middle = steps.begin() + static_cast<std::ptrdiff_t>(steps.size() / 2);
  std::nth_element(steps.begin(), middle, steps.end());
  return *middle / 4;
}

}  // namespace

ReplayCard::ReplayCard(const series::Recording& recording) : report_(std::make_shared<ReplayReport>()) {
  const auto calibration = default_calibration();
  const auto& time = recording.column("time").values;
  samples_.resize(time.size());
  recorded_.resize(time.size());
  for (auto& command : recorded_) command.output.fill(kNotRecorded);

  const double first = time.empty() ? 0 : time.front();
  const double zero = first < 0 || first > 1 ? first : 0;
  std::int64_t before = -1;
  for (std::size_t k = 0; k < time.size(); ++k) {
    const std::int64_t stamp = std::llround((time[k] - zero) * 1e9);
    before = samples_[k].time_ns = std::max(stamp, before + 1);
  }
  tolerance_ns_ = quarter_of_median_period(samples_);

  shape_.outputs = 2;
  for (int i = 0; i < kEncoders; ++i) {
    const auto source = find_source(recording, "enc" + std::to_string(i), calibration);
    if (!source) continue;
    shape_.encoders = i + 1;
    each_code(*source, true, [&](std::size_t k, double code) {
      samples_[k].encoder[static_cast<std::size_t>(i)] = wrapped(code, shape_.encoder_modulus);
    });
  }
  for (int i = 0; i < kInputs; ++i) {
    const auto source = find_source(recording, "ai" + std::to_string(i), calibration);
    if (!source) continue;
    shape_.inputs = i + 1;
    each_code(*source, true, [&](std::size_t k, double code) {
      samples_[k].input[static_cast<std::size_t>(i)] = clamped(code, shape_.input_max_code);
    });
  }
  for (int i = 0; i < kOutputs; ++i) {
    const auto source = find_source(recording, "ao" + std::to_string(i), calibration);
    if (!source) continue;
    shape_.outputs = std::max(shape_.outputs, i + 1);
    each_code(*source, false, [&](std::size_t k, double code) {
      recorded_[k].output[static_cast<std::size_t>(i)] = clamped(code, shape_.output_max_code);
    });
  }
  if (shape_.encoders == 0 && shape_.inputs == 0) {
    throw Error(ErrorKind::kBadInput, "replay_no_channels",
                "the recording has nothing a card could read; it needs enc0 to enc5, ai0 to ai7 [count], or "
                "angle, F1, "
                "F2, p1, p2.",
                {.file = recording.source});
  }
}

ReplayCard::~ReplayCard() {
  ReplayCard::vent();
}

Status ReplayCard::wait_until(std::int64_t time_ns) noexcept {
  apply_vent();
  while (next_ < samples_.size() && samples_[next_].time_ns + tolerance_ns_ < time_ns) ++next_;
  return next_ < samples_.size() ? Status::kOk : Status::kEndOfData;
}

Status ReplayCard::read(Sample& sample) noexcept {
  apply_vent();
  if (next_ >= samples_.size()) return Status::kEndOfData;
  sample = samples_[next_++];
  report_->rows_given.fetch_add(1, std::memory_order_relaxed);
  return Status::kOk;
}

Status ReplayCard::write(const Command& command) noexcept {
  apply_vent();
  const auto used = static_cast<std::size_t>(shape_.outputs);
  for (std::size_t i = 0; i < used; ++i) {
    if (command.output[i] > shape_.output_max_code) return Status::kOutOfRange;
  }
  std::copy_n(command.output.begin(), used, outputs_.output.begin());
  if (next_ == 0) return Status::kOk;
  const Command& then = recorded_[next_ - 1];
  for (std::size_t i = 0; i < used; ++i) {
    if (then.output[i] == kNotRecorded) continue;
    report_->codes_compared.fetch_add(1, std::memory_order_relaxed);
    if (then.output[i] != command.output[i]) report_->codes_different.fetch_add(1, std::memory_order_relaxed);
  }
  return Status::kOk;
}

Status ReplayCard::vent() noexcept {
  report_->vents.fetch_add(1, std::memory_order_relaxed);
  vent_asked_.store(true, std::memory_order_release);
  return Status::kOk;
}

void ReplayCard::apply_vent() noexcept {
  if (vent_asked_.exchange(false, std::memory_order_acq_rel)) outputs_ = Command{};
}

Status ReplayCard::outputs(Command& command) const noexcept {
  command = vent_asked_.load(std::memory_order_acquire) ? Command{} : outputs_;
  return Status::kOk;
}

Opened open_replay(const std::filesystem::path& path) {
  record::ReadOptions options;
  options.hash = false;
  return {.card = std::make_unique<ReplayCard>(record::read_recording(path, options)), .person = nullptr};
}

}  // namespace isac::card
