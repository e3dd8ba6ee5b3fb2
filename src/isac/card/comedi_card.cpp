#include "isac/card/comedi_card.hpp"

#include <comedilib.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <cmath>
#include <string>
#include <utility>
#include <vector>

#include "isac/card/comedi_clock.hpp"
#include "isac/core/error.hpp"

namespace isac::card {
namespace {

using Kind = SignalLine::Kind;

constexpr std::uint32_t kLargestModulus = 1u << 31;

struct Device {
  std::string path;
  comedi_t* handle = nullptr;
  bool senses = false, drives = false;
};

/// One list of instructions for one device.
struct List {
  comedi_t* handle = nullptr;
  std::vector<comedi_insn> instructions;
  /// All of them, or the list has failed somewhere and ended there.
  [[nodiscard]] bool run() noexcept {
    if (instructions.empty()) return true;
    comedi_insnlist list{static_cast<unsigned>(instructions.size()), instructions.data()};
    return comedi_do_insnlist(handle, &list) == static_cast<int>(instructions.size());
  }
};

unsigned aref_of(SignalLine::Reference reference) noexcept {
  switch (reference) {
    case SignalLine::Reference::kGround:
      return AREF_GROUND;
    case SignalLine::Reference::kCommon:
      return AREF_COMMON;
    case SignalLine::Reference::kDifferential:
      return AREF_DIFF;
    case SignalLine::Reference::kOther:
      return AREF_OTHER;
  }
  return AREF_GROUND;
}

class ComediCard final : public Card {
 public:
  ComediCard(const SignalTable& table, std::unique_ptr<ComediClock> clock)
      : table_(table), clock_(clock ? std::move(clock) : system_clock()) {
    comedi_set_global_oor_behavior(COMEDI_OOR_NUMBER);
    try {
      open_devices();
      for (const SignalLine& line : table_.lines) wire(line);
      look();
    } catch (...) {
      close_devices();
      throw;
    }
  }
  ~ComediCard() override {
    static_cast<void>(ComediCard::vent());
    close_devices();
  }
  ComediCard(const ComediCard&) = delete;
  ComediCard& operator=(const ComediCard&) = delete;

  [[nodiscard]] Shape shape() const noexcept override { return shape_; }
  [[nodiscard]] std::int64_t clock_ns() const noexcept override { return clock_->now_ns(); }

  Status wait_until(std::int64_t time_ns) noexcept override {
    clock_->sleep_until(time_ns);
    return Status::kOk;
  }

  Status read(Sample& sample) noexcept override {
    const std::int64_t stamp = std::max(clock_->now_ns(), last_stamp_ns_ + 1);
    for (List& list : reads_) {
      if (!list.run()) return Status::kDeviceError;
    }
    last_stamp_ns_ = stamp;
    sample = Sample{};
    sample.time_ns = stamp;
    for (std::size_t i = 0; i < sample.encoder.size(); ++i) sample.encoder[i] = encoder_[i] & counter_mask_;
    std::copy(input_.begin(), input_.end(), sample.input.begin());
    return Status::kOk;
  }

  Status write(const Command& command) noexcept override {
    const auto used = static_cast<std::size_t>(shape_.outputs);
    for (std::size_t i = 0; i < used; ++i) {
      if (command.output[i] > shape_.output_max_code) return Status::kOutOfRange;
    }
    for (std::size_t i = 0; i < used; ++i) output_[i] = command.output[i] + vented_[i];
    bool all = true;
    for (List& list : writes_) all = list.run() && all;
    if (!all) return Status::kDeviceError;
    for (std::size_t i = 0; i < used; ++i) held_[i].store(command.output[i], std::memory_order_release);
    return Status::kOk;
  }

  Status vent() noexcept override {
    bool all = true;
    for (List& list : vents_) all = list.run() && all;  // every device, also when one fails
    if (!all) return Status::kDeviceError;
    for (auto& code : held_) code.store(0, std::memory_order_release);
    return Status::kOk;
  }

  Status beat(bool level) noexcept override {
    if (!shape_.heartbeat) return Status::kNotPermitted;
    beat_ = level ? 1 : 0;
    return beats_.run() ? Status::kOk : Status::kDeviceError;
  }

  Status outputs(Command& command) const noexcept override {
    for (std::size_t i = 0; i < held_.size(); ++i)
      command.output[i] = held_[i].load(std::memory_order_acquire);
    return Status::kOk;
  }

  [[nodiscard]] std::string diagnose() override {
    std::string text;
    std::vector<std::string>
        dead;  // a board that failed once is not asked again: each channel may take a second
    for (const SignalLine& line : table_.lines) {
      const bool driven = line.kind == Kind::kOutput || line.kind == Kind::kHeartbeat;
      if (driven || std::find(dead.begin(), dead.end(), line.device) != dead.end()) continue;
      lsampl_t code = 0;
      const int rc = comedi_data_read(device(line.device).handle, line.subdevice, line.channel,
                                      range_of(line), aref_of(line.reference), &code);
      if (rc == 1) continue;
      dead.push_back(line.device);
      text += (text.empty() ? "" : "; ") + line.signal + " (" + place(line) +
              "): " + comedi_strerror(comedi_errno());
    }
    return text;
  }

  [[nodiscard]] std::vector<std::string> remarks() const {
    std::vector<std::string> remarks;
    for (const Device& one : devices_) {
      if (one.senses && one.drives)
        remarks.push_back("sensors and valves share " + one.path +
                          ": when a reading stalls, nobody can close the valves until it ends, up to 1 s; "
                          "put the valves on a "
                          "card of their own");
    }
    return remarks;
  }

 private:
  [[noreturn]] void absent(const std::string& text) const {
    throw Error(ErrorKind::kStopped, "card_absent", text, {table_.file, 0, 0});
  }
  [[noreturn]] void misfit(const SignalLine& line, const std::string& text) const {
    throw Error(ErrorKind::kBadInput, "table_misfit", line.signal + " (" + place(line) + "): " + text,
                {table_.file, 0, 0});
  }
  [[nodiscard]] static std::string place(const SignalLine& line) {
    return line.device + ", subdevice " + std::to_string(line.subdevice) + ", channel " +
           std::to_string(line.channel);
  }

  Device& device(const std::string& path) {
    return *std::find_if(devices_.begin(), devices_.end(),
                         [&](const Device& one) { return one.path == path; });
  }

  void open_devices() {
    for (const SignalLine& line : table_.lines) {
      const bool known = std::any_of(devices_.begin(), devices_.end(),
                                     [&](const Device& one) { return one.path == line.device; });
      if (known) continue;
      comedi_t* handle = comedi_open(line.device.c_str());
      if (handle == nullptr) {
        absent(
            line.device + " cannot be opened (" + comedi_strerror(comedi_errno()) +
            "); is the driver loaded, the card configured (comedi_config), and are you in the group iocard?");
      }
      devices_.push_back({.path = line.device, .handle = handle});
    }
    for (std::vector<List>* lists : {&reads_, &writes_, &vents_}) {
      for (const Device& one : devices_) lists->push_back({.handle = one.handle, .instructions = {}});
    }
  }

  void close_devices() noexcept {
    for (Device& one : devices_) comedi_close(one.handle);
    devices_.clear();
  }

  /// The index of the range that the table names by its ends.
  [[nodiscard]] unsigned range_of(const SignalLine& line) {
    if (line.kind == Kind::kEncoder) return 0;
    comedi_t* handle = device(line.device).handle;
    const int count = comedi_get_n_ranges(handle, line.subdevice, line.channel);
    std::string offered;
    for (int k = 0; k < count; ++k) {
      const comedi_range* range =
          comedi_get_range(handle, line.subdevice, line.channel, static_cast<unsigned>(k));
      if (range == nullptr) continue;
      const bool volt = range->unit == UNIT_volt, milliampere = range->unit == UNIT_mA;
      const auto near = [&](double a, double b) {
        return std::abs(a - b) <=
               1e-4 * (line.range_high - line.range_low);  // Comedi gives ends in millionths
      };
      if (near(range->min, line.range_low) && near(range->max, line.range_high) &&
          ((volt && line.unit == SignalLine::Unit::kVolt) ||
           (milliampere && line.unit == SignalLine::Unit::kMilliampere)))
        return static_cast<unsigned>(k);
      std::string ends = std::to_string(range->min) + ".." + std::to_string(range->max);
      offered += (offered.empty() ? "" : ", ") + ends + (volt ? " V" : milliampere ? " mA" : "");
    }
    misfit(line, "the card has no range " + line.range_text + "; it has " + offered);
  }

  /// A digital output of its own list: it tells of the loop, and no failed valve may keep it going.
  void wire_heartbeat(const SignalLine& line, const Device& on) {
    std::array<lsampl_t, 1> direction = {INSN_CONFIG_DIO_OUTPUT};
    comedi_insn insn{};
    insn.n = 1;
    insn.subdev = line.subdevice;
    insn.chanspec = CR_PACK(line.channel, 0, 0);
    if (comedi_get_subdevice_type(on.handle, line.subdevice) == COMEDI_SUBD_DIO) {
      insn.insn = INSN_CONFIG;
      insn.data = direction.data();
      if (comedi_do_insn(on.handle, &insn) < 0)
        misfit(line, std::string("the line cannot be an output (") + comedi_strerror(comedi_errno()) + ")");
    }
    insn.insn = INSN_WRITE;
    insn.data = &beat_;
    beats_ = {.handle = on.handle, .instructions = {insn}};
    shape_.heartbeat = true;
  }

  void wire(const SignalLine& line) {
    Device& on = device(line.device);
    check_place(line, on);
    if (line.kind == Kind::kHeartbeat) return wire_heartbeat(line, on);
    const std::uint32_t maxdata = comedi_get_maxdata(on.handle, line.subdevice, line.channel);
    if (maxdata == 0) misfit(line, "the driver does not say how wide the converter is");
    const unsigned range = range_of(line);
    const auto i = static_cast<std::size_t>(line.index);
    comedi_insn insn{};
    insn.n = 1;
    insn.subdev = line.subdevice;
    insn.chanspec = CR_PACK(line.channel, range, aref_of(line.reference));
    if (line.kind == Kind::kOutput) {
      on.drives = true;
      shape_.outputs = line.index + 1;
      check_vented(line, on, range, maxdata);
      vented_[i] = line.vented;
      closed_[i] = line.vented;
      same_width(line, line.index == 0, shape_.output_max_code, maxdata - line.vented);
      insn.insn = INSN_WRITE;
      insn.data = &output_[i];
      list_of(writes_, on).instructions.push_back(insn);
      insn.data = &closed_[i];
      list_of(vents_, on).instructions.push_back(insn);
      return;
    }
    on.senses = true;
    insn.insn = INSN_READ;
    if (line.kind == Kind::kInput) {
      shape_.inputs = line.index + 1;
      same_width(line, line.index == 0, shape_.input_max_code, maxdata);
      insn.data = &input_[i];
    } else {
      shape_.encoders = line.index + 1;
      const std::uint32_t modulus = maxdata >= kLargestModulus - 1 ? kLargestModulus : maxdata + 1;
      same_width(line, line.index == 0, shape_.encoder_modulus, modulus);
      if (modulus == kLargestModulus) counter_mask_ = kLargestModulus - 1;
      set_up(line, on);
      insn.data = &encoder_[i];
    }
    list_of(reads_, on).instructions.push_back(insn);
  }

  void check_place(const SignalLine& line, const Device& on) const {
    const char* driver = comedi_get_driver_name(on.handle);
    if (!line.driver.empty() && (driver == nullptr || line.driver != driver))
      misfit(line, "the table is for the driver " + line.driver + ", and " + (driver ? driver : "another") +
                       " is behind this device; are two cards exchanged?");
    if (static_cast<int>(line.subdevice) >= comedi_get_n_subdevices(on.handle))
      misfit(line, "the card has no such subdevice");
    const int wanted = line.kind == Kind::kEncoder ? COMEDI_SUBD_COUNTER
                       : line.kind == Kind::kInput ? COMEDI_SUBD_AI
                                                   : COMEDI_SUBD_AO;
    const int found = comedi_get_subdevice_type(on.handle, line.subdevice);
    const bool digital = found == COMEDI_SUBD_DIO || found == COMEDI_SUBD_DO;
    if (line.kind == Kind::kHeartbeat ? !digital : found != wanted)
      misfit(line, "the subdevice is of another kind than the signal");
    if (static_cast<int>(line.channel) >= comedi_get_n_channels(on.handle, line.subdevice))
      misfit(line, "the subdevice has no such channel");
  }

  /// A closed valve has the least current or no voltage; code 0 of a bipolar output would be its full negative voltage.
  void check_vented(const SignalLine& line, const Device& on, unsigned range, std::uint32_t maxdata) const {
    if (line.vented >= maxdata) misfit(line, "'vented' is beyond the converter");
    comedi_range* ends = comedi_get_range(on.handle, line.subdevice, line.channel, range);
    const double closed = comedi_to_phys(line.vented, ends, maxdata);
    const double step = (ends->max - ends->min) / static_cast<double>(maxdata);
    const double least = std::max(ends->min, 0.0);
    if (std::abs(closed - least) <= step) return;
    const lsampl_t mend = comedi_from_phys(least, ends, maxdata);
    misfit(line, "code " + std::to_string(line.vented) + " means " + std::to_string(closed) +
                     " and opens a valve; write vented = " + std::to_string(mend));
  }

  void same_width(const SignalLine& line, bool first, std::uint32_t& width, std::uint32_t found) const {
    if (first) width = found;
    if (width != found)
      misfit(line, "its width differs from the first of its kind (" + std::to_string(found) + " and " +
                       std::to_string(width) + "); use channels of one width");
  }

  void set_up(const SignalLine& line, const Device& on) const {
    if (line.setup == SignalLine::Setup::kNone) return;
    std::array<lsampl_t, 2> data{};
    comedi_insn insn{};
    insn.insn = INSN_CONFIG;
    insn.subdev = line.subdevice;
    insn.chanspec = CR_PACK(line.channel, 0, 0);
    insn.data = data.data();
    insn.n = 1;
    if (line.setup == SignalLine::Setup::kQuadratureX4) {
      data = {INSN_CONFIG_SET_COUNTER_MODE, NI_GPCT_COUNTING_MODE_QUADRATURE_X4_BITS};
      insn.n = 2;
    }
    if (comedi_do_insn(on.handle, &insn) < 0)
      misfit(line, std::string("the counter refuses its setup (") + comedi_strerror(comedi_errno()) + ")");
  }

  [[nodiscard]] static List& list_of(std::vector<List>& lists, const Device& on) {
    return *std::find_if(lists.begin(), lists.end(),
                         [&](const List& list) { return list.handle == on.handle; });
  }

  /// Is somebody there? An empty slot opens, attaches and answers, with ones on every line.
  void look() {
    Sample sample;
    if (const Status status = read(sample); !ok(status)) {
      const std::string who = diagnose();
      absent("the card does not answer: " + (who.empty() ? std::string("the list of readings failed") : who));
    }
    for (const SignalLine& line : table_.lines) {
      const auto i = static_cast<std::size_t>(line.index);
      const bool beyond = (line.kind == Kind::kInput && input_[i] > shape_.input_max_code) ||
                          (line.kind == Kind::kEncoder && sample.encoder[i] >= shape_.encoder_modulus);
      if (beyond) {
        absent(line.signal + " (" + place(line) + ") reads " +
               std::to_string(line.kind == Kind::kInput ? input_[i] : encoder_[i]) +
               ", which its converter does not have: nobody is in that slot; check address and power");
      }
    }
  }

  SignalTable table_;
  std::unique_ptr<ComediClock> clock_;
  Shape shape_;
  std::vector<Device> devices_;
  std::vector<List> reads_, writes_, vents_;
  List beats_;
  lsampl_t beat_ = 0;
  std::array<lsampl_t, kEncoders> encoder_{};
  std::array<lsampl_t, kInputs> input_{};
  std::array<lsampl_t, kOutputs> output_{}, closed_{};  ///< driver's codes: of the next write, and of a vent
  std::array<std::uint32_t, kOutputs> vented_{};
  std::array<std::atomic<std::uint32_t>, kOutputs> held_{};
  std::uint32_t counter_mask_ = ~0u;
  std::int64_t last_stamp_ns_ = -1;
};

}  // namespace

Opened open_comedi(const SignalTable& table, std::unique_ptr<ComediClock> clock) {
  auto card = std::make_unique<ComediCard>(table, std::move(clock));
  Opened opened;
  opened.remarks = card->remarks();
  opened.card = std::move(card);
  return opened;
}

}  // namespace isac::card
