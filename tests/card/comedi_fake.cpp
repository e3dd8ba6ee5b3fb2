#include "comedi_fake.hpp"

#include <comedilib.h>

#include <cerrno>
#include <cmath>
#include <cstring>
#include <limits>
#include <mutex>
#include <utility>

namespace isac::test {
namespace {

std::mutex kernel;  ///< as a device's lock there: one caller at a time
int last_errno = 0;
comedi_oor_behavior behaviour = COMEDI_OOR_NAN;
comedi_range answered_range;

int fail(int number) {
  last_errno = number;
  return -1;
}

}  // namespace

std::map<std::string, FakeBoard>& boards() {
  static std::map<std::string, FakeBoard> all;
  return all;
}

FakeBoard& add_board(const std::string& path, FakeBoard board) {
  for (FakeSubdevice& one : board.subdevices) one.value.assign(static_cast<std::size_t>(one.channels), 0);
  return boards()[path] = std::move(board);
}

FakeBoard controller_board() {
  return {.driver = "isac_rig",
          .subdevices = {{COMEDI_SUBD_AI, 4, 4095, {{0, 10, UNIT_volt}}, {}},
                         {COMEDI_SUBD_AO, 12, 4095, {{4, 20, UNIT_mA}}, {}},
                         {COMEDI_SUBD_COUNTER, 6, 0xffffff, {{0, 1, UNIT_none}}, {}},
                         {COMEDI_SUBD_DO, 1, 1, {{0, 5, UNIT_volt}}, {}}},
          .last_configuration = {},
          .range_read = {}};
}
FakeBoard labpc_board() {
  return {.driver = "ni_labpc",
          .subdevices = {{COMEDI_SUBD_AI,
                          8,
                          4095,
                          {{-5, 5, UNIT_volt},
                           {-2.5, 2.5, UNIT_volt},
                           {-1, 1, UNIT_volt},
                           {-0.5, 0.5, UNIT_volt},
                           {-0.25, 0.25, UNIT_volt},
                           {-0.1, 0.1, UNIT_volt},
                           {-0.05, 0.05, UNIT_volt},
                           {0, 10, UNIT_volt},
                           {0, 5, UNIT_volt},
                           {0, 2, UNIT_volt},
                           {0, 1, UNIT_volt},
                           {0, 0.5, UNIT_volt},
                           {0, 0.2, UNIT_volt},
                           {0, 0.1, UNIT_volt}},
                          {}}},
          .last_configuration = {},
          .range_read = {}};
}
FakeBoard s626_board() {
  const FakeSubdevice none{COMEDI_SUBD_DIO, 16, 1, {{0, 5, UNIT_volt}}, {}};
  return {.driver = "s626",
          .subdevices = {{COMEDI_SUBD_AI, 16, 0x3fff, {{-5, 5, UNIT_volt}, {-10, 10, UNIT_volt}}, {}},
                         {COMEDI_SUBD_AO, 4, 0x3fff, {{-10, 10, UNIT_volt}}, {}},
                         none,
                         none,
                         none,
                         {COMEDI_SUBD_COUNTER, 6, 0xffffff, {{0, 1, UNIT_none}}, {}}},
          .last_configuration = {},
          .range_read = {}};
}
FakeBoard pci1724_board() {
  return {.driver = "adv_pci1724",
          .subdevices =
              {{COMEDI_SUBD_AO, 32, 0x3fff, {{-10, 10, UNIT_volt}, {0, 20, UNIT_mA}, {4, 20, UNIT_mA}}, {}}},
          .last_configuration = {},
          .range_read = {}};
}

}  // namespace isac::test

using isac::test::FakeBoard;
using isac::test::FakeSubdevice;

struct comedi_t_struct {
  FakeBoard* board;
};

namespace {

FakeSubdevice* subdevice(comedi_t* it, unsigned index) {
  return index < it->board->subdevices.size() ? &it->board->subdevices[index] : nullptr;
}

/// One instruction, under the lock.
int run(comedi_t* it, comedi_insn* insn) {
  FakeBoard& board = *it->board;
  ++board.instructions;
  FakeSubdevice* on = subdevice(it, insn->subdev);
  const unsigned channel = CR_CHAN(insn->chanspec);
  if (on == nullptr || channel >= on->value.size()) return isac::test::fail(EINVAL);
  std::uint32_t& value = on->value[channel];
  if (insn->insn == INSN_WRITE) {
    if (board.fail_writes) return isac::test::fail(EIO);
    if (insn->data[0] > on->maxdata) return isac::test::fail(EINVAL);
    value = insn->data[0];
    return 1;
  }
  if (insn->insn == INSN_CONFIG) {
    ++board.configurations;
    board.last_configuration.assign(insn->data, insn->data + insn->n);
    return static_cast<int>(insn->n);
  }
  if (static_cast<int>(insn->subdev) == board.fail_subdevice &&
      static_cast<int>(channel) == board.fail_channel)
    return isac::test::fail(board.fail_errno);
  board.range_read[channel] = CR_RANGE(insn->chanspec);
  insn->data[0] = board.empty_slot ? 65535 : value;
  return 1;
}

}  // namespace

extern "C" {

comedi_t* comedi_open(const char* path) {
  const auto found = isac::test::boards().find(path);
  if (found == isac::test::boards().end()) {
    isac::test::fail(ENODEV);
    return nullptr;
  }
  ++found->second.open_handles;
  return new comedi_t_struct{&found->second};
}
int comedi_close(comedi_t* it) {
  --it->board->open_handles;
  delete it;
  return 0;
}
int comedi_errno(void) {
  return isac::test::last_errno;
}
const char* comedi_strerror(int number) {
  return std::strerror(number);
}
comedi_oor_behavior comedi_set_global_oor_behavior(comedi_oor_behavior wanted) {
  return std::exchange(isac::test::behaviour, wanted);
}
int comedi_get_n_subdevices(comedi_t* it) {
  return static_cast<int>(it->board->subdevices.size());
}
const char* comedi_get_driver_name(comedi_t* it) {
  return it->board->driver.c_str();
}
int comedi_get_subdevice_type(comedi_t* it, unsigned index) {
  return subdevice(it, index)->type;
}
int comedi_get_n_channels(comedi_t* it, unsigned index) {
  return subdevice(it, index)->channels;
}
lsampl_t comedi_get_maxdata(comedi_t* it, unsigned index, unsigned) {
  return subdevice(it, index)->maxdata;
}
int comedi_get_n_ranges(comedi_t* it, unsigned index, unsigned) {
  return static_cast<int>(subdevice(it, index)->ranges.size());
}
comedi_range* comedi_get_range(comedi_t* it, unsigned index, unsigned, unsigned range) {
  const isac::test::FakeRange& found = subdevice(it, index)->ranges.at(range);
  isac::test::answered_range = {found.min, found.max, found.unit};
  return &isac::test::answered_range;
}
double comedi_to_phys(lsampl_t data, comedi_range* range, lsampl_t maxdata) {
  if ((data == 0 || data == maxdata) && isac::test::behaviour == COMEDI_OOR_NAN)
    return std::numeric_limits<double>::quiet_NaN();
  return range->min + (range->max - range->min) * data / maxdata;
}
lsampl_t comedi_from_phys(double value, comedi_range* range, lsampl_t maxdata) {
  return static_cast<lsampl_t>(std::lround((value - range->min) / (range->max - range->min) * maxdata));
}
int comedi_do_insn(comedi_t* it, comedi_insn* insn) {
  const std::scoped_lock lock(isac::test::kernel);
  return run(it, insn);
}
int comedi_do_insnlist(comedi_t* it, comedi_insnlist* list) {
  const std::scoped_lock lock(isac::test::kernel);
  ++it->board->lists;
  for (unsigned k = 0; k < list->n_insns; ++k)
    if (run(it, &list->insns[k]) < 0) return -1;
  return static_cast<int>(list->n_insns);
}
int comedi_data_read(comedi_t* it, unsigned index, unsigned channel, unsigned range, unsigned aref,
                     lsampl_t* data) {
  const std::scoped_lock lock(isac::test::kernel);
  comedi_insn insn{};
  insn.insn = INSN_READ;
  insn.n = 1;
  insn.data = data;
  insn.subdev = index;
  insn.chanspec = CR_PACK(channel, range, aref);
  return run(it, &insn);
}

}  // extern "C"
