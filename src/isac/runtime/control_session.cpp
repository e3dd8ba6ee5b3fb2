#include "isac/runtime/control_session.hpp"

#include <array>
#include <chrono>
#include <cstring>
#include <memory>
#include <optional>
#include <thread>

#include "isac/core/error.hpp"
#include "isac/record/csv_reader.hpp"
#include "isac/runtime/flight_recorder.hpp"
#include "isac/runtime/paced_card.hpp"
#include "isac/runtime/ring_writer.hpp"
#include "isac/runtime/shared_valves.hpp"
#include "isac/runtime/stop_signals.hpp"

namespace isac::runtime {
namespace {

namespace fs = std::filesystem;

constexpr auto kView = std::chrono::milliseconds(50);
constexpr std::size_t kRingRows = 8192;

template <std::size_t N>
void put(std::array<char, N>& target, const std::string& text) noexcept {
  const std::size_t count = std::min(N - 1, text.size());
  std::memcpy(target.data(), text.data(), count);
  target[count] = '\0';
}

/// What travels from the child to the parent, also when the child does not live to say it.
struct Shared {
  Live live;
  ValveMemory valves;
  std::atomic<bool> permit{false};
  // Written by the child before it leaves, read by the parent after its end.
  std::atomic<bool> told{false}, failed{false};
  LoopEnd end;
  RealTime real_time;
  bool asked_real_time = false;
  std::uint64_t rows = 0, dropped = 0;
  std::atomic<std::uint8_t> warnings{0};
  CommandComparison comparison;
  std::uint64_t recorded_rows = 0;
  JointWiring wiring;
  std::atomic<bool> wired{false};
  ErrorKind error_kind = ErrorKind::kBadInput;
  long error_line = 0, error_column = 0;
  std::array<char, 64> error_code{};
  std::array<char, 512> error_file{}, diagnosis{};
  std::array<char, 1024> error_text{};
};

/// Everything a cycle goes into.
class Recorder final : public CycleSink {
 public:
  Recorder(FlightRecorder& flight, Shared& shared, RingWriter<CycleRow>* writer, CommandComparer* comparer,
           bool waits) noexcept
      : flight_(flight), shared_(shared), writer_(writer), comparer_(comparer), waits_(waits) {}
  bool take(const CycleRow& row) noexcept override {
    flight_.push(row);
    shared_.warnings.fetch_or(row.warnings, std::memory_order_relaxed);
    if (comparer_ != nullptr) comparer_->compare(row);
    if (writer_ == nullptr) return true;
    if (waits_) return writer_->push_waiting(row);
    static_cast<void>(writer_->push(row));  // lost rows are counted; the loop goes on
    return !writer_->failed();
  }

 private:
  FlightRecorder& flight_;
  Shared& shared_;
  RingWriter<CycleRow>* writer_;
  CommandComparer* comparer_;
  bool waits_;
};

void stage(Shared& shared, Heartbeat::Stage now) noexcept {
  shared.live.heart.stage.store(static_cast<int>(now), std::memory_order_release);
}

/// The child's side.
class Child {
 public:
  Child(const ControlRun& run, RunObserver& observer, Shared& shared, FlightRecorder& flight)
      : run_(run), observer_(observer), shared_(shared), flight_(flight), virtual_(is_virtual(run.card)) {}

  int operator()() noexcept {
    try {
      work();
      shared_.told.store(true, std::memory_order_release);
      return 0;
    } catch (const Error& error) {
      shared_.error_kind = error.kind();
      put(shared_.error_code, error.code());
      put(shared_.error_text, error.text());
      put(shared_.error_file, error.place().file);
      shared_.error_line = error.place().line;
      shared_.error_column = error.place().column;
    } catch (const std::exception& error) {
      shared_.error_kind = ErrorKind::kStopped;
      put(shared_.error_code, "unexpected");
      put(shared_.error_text, error.what());
    }
    shared_.failed.store(true, std::memory_order_release);
    return static_cast<int>(shared_.error_kind);
  }

 private:
  void open_card() {
    card::Opened opened = card::open(run_.card);
    remarks_ = std::move(opened.remarks);
    person_ = std::move(opened.person);
    card_ = std::move(opened.card);
    if (!virtual_) return;
    if (run_.pace_real) card_ = std::make_unique<PacedCard>(std::move(card_));
    card_ = std::make_unique<SharedValves>(std::move(card_), shared_.valves);
  }

  std::unique_ptr<Director> director() {
    if (run_.replayed.empty()) return std::make_unique<MotionDirector>(run_.motion, shared_.permit);
    const series::Recording recorded =
        record::read_recording(run_.replayed, {.map = {}, .require_time = true, .hash = false});
    comparer_.emplace(recorded, run_.joints);
    return std::make_unique<RecordedDirector>(recorded, run_.joints);
  }

  void prepare_thread() {
    if (virtual_ && !run_.pace_real) return;
    shared_.real_time = prepare_real_time(run_.priority);
    shared_.asked_real_time = true;
  }

  void work() {
    keep_stacks_small();
    open_card();
    StopSignals::vent_on_death(card_.get());
    const JointWiring wiring = wire_joints(run_.rig, card_->shape(), run_.joints);
    shared_.wiring = wiring;
    shared_.wired.store(true, std::memory_order_release);
    ControlLoop loop(*card_, wiring, run_.settings);
    if (const Status status = loop.configure(); !ok(status)) {
      throw Error(ErrorKind::kBadInput, "settings_refused",
                  "joint " + std::to_string(loop.failed_joint() + 1) + " cannot be controlled so: " +
                      describe(status) + " (a measured torque needs both force sensors)");
    }
    const std::unique_ptr<Director> director = this->director();
    std::optional<RunLog> log;
    std::optional<RingWriter<CycleRow>> writer;
    if (!run_.log.empty()) {
      log.emplace(run_.log, wiring, run_.metadata);
      writer.emplace([&log](const CycleRow& row) { log->append(row); }, kRingRows);
    }
    Recorder recorder(flight_, shared_, writer ? &*writer : nullptr, comparer_ ? &*comparer_ : nullptr,
                      virtual_ && !run_.pace_real);
    shared_.permit.store(!run_.ask_to_arm);

    std::atomic<bool> ready{false}, go{false}, done{false};
    std::thread thread([&] {
      prepare_thread();
      ready.store(true, std::memory_order_release);
      while (!go.load(std::memory_order_acquire)) std::this_thread::sleep_for(std::chrono::milliseconds(1));
      if (refused_) return done.store(true, std::memory_order_release);
      stage(shared_, Heartbeat::Stage::kRunning);
      shared_.end = loop.run(*director, shared_.live.heart.stop, &shared_.live, &recorder);
      static_cast<void>(card_->vent());
      stage(shared_, Heartbeat::Stage::kLeft);
      done.store(true, std::memory_order_release);
    });
    while (!ready.load(std::memory_order_acquire)) std::this_thread::sleep_for(std::chrono::milliseconds(1));
    refused_ = run_.require_real_time && shared_.asked_real_time && !shared_.real_time.complete();
    if (!refused_) observer_.started(shared_.asked_real_time ? &shared_.real_time : nullptr, remarks_);
    go.store(true, std::memory_order_release);
    watch(done);
    thread.join();
    StopSignals::vent_on_death(nullptr);
    if (refused_) {
      throw Error(ErrorKind::kStopped, "no_real_time",
                  "real time was required and is not permitted: " + shared_.real_time.words());
    }
    if (!ok(shared_.end.status) && shared_.end.status != Status::kEndOfData)
      put(shared_.diagnosis, card_->diagnose());
    if (comparer_) {
      shared_.comparison = comparer_->result();
      shared_.recorded_rows = comparer_->recorded_rows();
    }
    if (writer) {
      shared_.dropped = writer->dropped();
      writer->finish();
      log->close();
      shared_.rows = log->rows();
    }
  }

  void watch(const std::atomic<bool>& done) {
    auto next_view = std::chrono::steady_clock::now();
    while (!done.load(std::memory_order_acquire)) {
      if (StopSignals::requested().load(std::memory_order_relaxed))
        shared_.live.heart.stop.store(true, std::memory_order_relaxed);
      if (const auto now = std::chrono::steady_clock::now(); now >= next_view) {
        next_view = now + kView;
        observer_.status(shared_.live);
        if (!shared_.permit.load(std::memory_order_relaxed) && observer_.agrees()) shared_.permit.store(true);
      }
      std::this_thread::sleep_for(std::chrono::milliseconds(2));
    }
  }

  const ControlRun& run_;
  RunObserver& observer_;
  Shared& shared_;
  FlightRecorder& flight_;
  bool virtual_;
  std::vector<std::string> remarks_;
  std::unique_ptr<card::Card> card_;
  std::unique_ptr<card::Person> person_;
  std::optional<CommandComparer> comparer_;
  std::atomic<bool> refused_{false};
};

void write_flight(const fs::path& path, const ControlRun& run, const JointWiring& wiring,
                  const std::vector<CycleRow>& rows) {
  std::error_code ignored;
  fs::path backup = path;
  if (fs::exists(path)) fs::rename(path, backup += ".bak", ignored);
  std::map<std::string, std::string> metadata = run.metadata;
  metadata["flight"] = "the last cycles before the end";
  RunLog log(path, wiring, metadata);
  for (const CycleRow& row : rows) log.append(row);
  log.close();
}

}  // namespace

bool is_virtual(const std::string& card) {
  return card.starts_with("sim:") || card.starts_with("replay:");
}

bool ControlOutcome::as_planned() const noexcept {
  using Why = LoopEnd::Why;
  return told && (loop.why == Why::kDone || loop.why == Why::kStopped || loop.why == Why::kCardEnded);
}

ControlOutcome run_control(const ControlRun& run, RunObserver& observer, const std::atomic<bool>& stop) {
  SharedMemory memory(sizeof(Shared)), ring(FlightRecorder::bytes(run.flight_cycles));
  Shared& shared = *new (memory.data()) Shared;
  FlightRecorder flight(ring.data(), run.flight_cycles);
  const bool simulated = is_virtual(run.card);
  std::unique_ptr<card::Card> valves;
  if (simulated) {
    valves = std::make_unique<ValveHandle>(card::Shape{.outputs = card::kOutputs}, shared.valves);
  } else {
    valves = card::open(run.card).card;  // a handle of its own
  }
  Child child(run, observer, shared, flight);
  SupervisorOptions watcher{.limits = run.beat};
  if (!simulated) watcher.priority = run.priority + 1;

  ControlOutcome outcome;
  outcome.supervisor = supervise(*valves, shared.live.heart, stop, watcher, [&child] { return child(); });
  if (shared.failed.load(std::memory_order_acquire)) {
    throw Error(shared.error_kind, shared.error_code.data(), shared.error_text.data(),
                {shared.error_file.data(), shared.error_line, shared.error_column});
  }
  outcome.told = shared.told.load(std::memory_order_acquire);
  outcome.loop = shared.end;
  outcome.real_time = shared.real_time;
  outcome.asked_real_time = shared.asked_real_time;
  outcome.rows = shared.rows;
  outcome.dropped = shared.dropped;
  outcome.warnings = shared.warnings.load();
  outcome.diagnosis = shared.diagnosis.data();
  outcome.comparison = shared.comparison;
  outcome.recorded_rows = shared.recorded_rows;
  if (!outcome.as_planned() && !run.flight.empty() && shared.wired.load(std::memory_order_acquire)) {
    if (const std::vector<CycleRow> rows = flight.rows(); !rows.empty()) {
      write_flight(run.flight, run, shared.wiring, rows);
      outcome.flight = run.flight;
    }
  }
  return outcome;
}

}  // namespace isac::runtime
