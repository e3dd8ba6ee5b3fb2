/// @file
/// A card of Linux' Comedi: any driver, by a table of signals (signal_table.hpp): "comedi:data/cards/testbed.toml".
///
/// What Comedi does that a caller must know, and what is done about it:
///   - a failed instruction ends its list: reads and writes go in lists of their own, so that a dead sensor cannot keep a valve
///     from closing; one system call per device and direction
///   - a write above the converter's range is refused and the old value stays: codes are checked before, all of them
///   - a slot without a card answers 65535: passed on as it is, for the loop's watch; while opening it is refused
///   - comedi_to_phys gives NaN at both ends of a range by default: that is switched off before it is asked
///   - outputs keep their value when a process dies: see runtime/supervisor.hpp
///   - a dead board stalls the caller for up to a second, and with it everybody who uses the same device; a valve on a device of
///     its own can be closed meanwhile. One device for both is remarked on
///
/// Units: driver's codes; of outputs, counted from the `vented` code of the table. Counters of 32 bits are used modulo 2³¹.
/// The stamp of a sample is taken before its reading begins; clock_ns() tells how long it took. Clock: CLOCK_MONOTONIC from
/// opening, or one that a test brings. Real time: read, write, vent and wait_until allocate nothing and make one system call
/// per device. Threads: as card.hpp; vent() uses lists of its own and may come from a signal handler.
/// Errors: opening throws isac::Error: stopped (nobody there), bad input (the table does not fit the card). Source: seed C.4,
/// E.1.4; comedi(7). Where the program was built without libcomedi, opening says so.
#pragma once

#include <memory>

#include "isac/card/card.hpp"
#include "isac/card/comedi_clock.hpp"
#include "isac/card/signal_table.hpp"

namespace isac::card {

/// `clock` null: the system's. No person is at such a card.
[[nodiscard]] Opened open_comedi(const SignalTable& table, std::unique_ptr<ComediClock> clock = nullptr);

}  // namespace isac::card
