#include "isac/record/csv_reader.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <string>

#include "isac/core/error.hpp"
#include "isac/core/units.hpp"
#include "isac/record/sha256.hpp"

namespace {

using isac::Error;
using isac::ErrorKind;
using isac::record::BlockReader;
using isac::record::parse_column_map;
using isac::record::parse_recording;
using isac::record::ReadOptions;
using isac::series::Recording;

ReadOptions with_maps(std::initializer_list<const char*> maps, bool require_time = true) {
  ReadOptions options;
  for (const char* map : maps) options.map.push_back(parse_column_map(map));
  options.require_time = require_time;
  return options;
}

Recording read(const std::string& text, const ReadOptions& options = {}) {
  return parse_recording(text, "run.csv", options);
}

std::vector<double> values(const Recording& recording, const char* name) {
  return recording.column(name).values;
}

Error error_of(const std::string& text, const ReadOptions& options = {}) {
  try {
    (void)read(text, options);
  } catch (const Error& error) {
    return error;
  }
  ADD_FAILURE() << "was read without complaint: " << text.substr(0, 200);
  return {ErrorKind::kUsage, "none", "none"};
}

TEST(CsvReader, reads_metadata_header_and_numbers_into_si_columns) {
  const Recording run = read(
      "# experiment: constant-pressure\n#started:2003-05-01T14:30:00Z\n# just a remark\n"
      "time [ms],angle [deg],p1 [kg/cm2],F1 [kgf],torque [Nm]\n"
      "0,180,1,1,-0.5\n2.5,-90,3,2,1e-3\n");
  ASSERT_EQ(run.rows(), 2U);
  EXPECT_EQ(run.meta("experiment"), "constant-pressure");
  EXPECT_EQ(run.meta("started"), "2003-05-01T14:30:00Z");
  EXPECT_EQ(run.metadata.size(), 2U);
  EXPECT_EQ(run.source, "run.csv");
  EXPECT_EQ(values(run, "time"), (std::vector<double>{0.0, 2.5 * 1e-3}));
  EXPECT_EQ(values(run, "angle"), (std::vector<double>{180 * (isac::kPi / 180), -90 * (isac::kPi / 180)}));
  EXPECT_EQ(values(run, "p1"), (std::vector<double>{98066.5, 3 * 98066.5}));
  EXPECT_EQ(values(run, "F1"), (std::vector<double>{9.80665, 2 * 9.80665}));
  EXPECT_EQ(values(run, "torque"), (std::vector<double>{-0.5, 1e-3}));
  EXPECT_EQ(run.column("p1").unit, "Pa");
  EXPECT_EQ(run.column("torque").unit, "N m");
}

TEST(CsvReader, puts_time_first_and_keeps_the_order_of_the_others) {
  const Recording run = read("zeta,angle [rad],time [s],alpha [V]\n1,2,3,4\n5,6,7,8\n");
  ASSERT_EQ(run.columns.size(), 4U);
  EXPECT_EQ(run.columns[0].name, "time");
  EXPECT_EQ(run.columns[1].name, "zeta");
  EXPECT_EQ(run.columns[2].name, "angle");
  EXPECT_EQ(run.columns[3].name, "alpha");
  EXPECT_EQ(run.columns[0].values, (std::vector<double>{3, 7}));
  EXPECT_EQ(run.columns[1].values, (std::vector<double>{1, 5}));
}

TEST(CsvReader, takes_empty_cells_and_nan_as_missing_samples) {
  const Recording run = read("time [s],p1 [bar],p2 [bar]\n0,,1\n1,nan,\n2,NaN,  \n3, 4 ,NAN\n4,\"5\",\"\"\n");
  const auto p1 = values(run, "p1");
  const auto p2 = values(run, "p2");
  EXPECT_TRUE(std::isnan(p1[0]) && std::isnan(p1[1]) && std::isnan(p1[2]));
  EXPECT_EQ(p1[3], 4e5);
  EXPECT_EQ(p1[4], 5e5);
  EXPECT_EQ(p2[0], 1e5);
  EXPECT_TRUE(std::isnan(p2[1]) && std::isnan(p2[2]) && std::isnan(p2[3]) && std::isnan(p2[4]));
}

TEST(CsvReader, gives_celsius_in_kelvin) {
  EXPECT_EQ(values(read("time [s],temperature [degC]\n0,20\n"), "temperature")[0], 20.0 + 273.15);
}

TEST(CsvReader, recognises_separator_and_decimal_sign) {
  const std::vector<double> time{0.5, 1.25};
  const std::vector<double> angle{-1.75, 1000.0};
  for (const char* text :
       {"time [s],angle [rad]\n0.5,-1.75\n1.25,1e3\n", "time [s];angle [rad]\n0.5;-1.75\n1.25;1e3\n",
        "time [s];angle [rad]\n0,5;-1,75\n1,25;1e3\n", "time [s]\tangle [rad]\n0.5\t-1.75\n1.25\t1e3\n",
        "time [s]\tangle [rad]\n0,5\t-1,75\n1,25\t1,0e3\n",
        "time [s] ; angle [rad]\n 0,5 ; -1,75\n 1,25 ; +1000\n"}) {
    const Recording run = read(text);
    EXPECT_EQ(values(run, "time"), time) << text;
    EXPECT_EQ(values(run, "angle"), angle) << text;
  }
}

TEST(CsvReader, decides_the_decimal_sign_by_the_first_row_that_has_one) {
  const Recording run = read("time [s];angle [rad]\n# a remark with 1.5 in it\n0;0\n1;0\n2;0,5\n3;1,5\n");
  EXPECT_EQ(values(run, "angle"), (std::vector<double>{0, 0, 0.5, 1.5}));
}

TEST(CsvReader, prefers_the_separator_that_header_and_rows_agree_on) {
  const Recording run =
      read("\"Zeit, rel\";\"Pos, abs\";Kraft, N\n0,5;1,5;2,5\n", with_maps({"time=Zeit, rel:s"}));
  EXPECT_EQ(run.columns.size(), 3U);
  EXPECT_EQ(values(run, "time"), (std::vector<double>{0.5}));
  EXPECT_EQ(values(run, "Kraft, N"), (std::vector<double>{2.5}));
}

TEST(CsvReader, reads_windows_line_ends_a_byte_order_mark_blank_lines_and_a_missing_last_line_feed) {
  const Recording run =
      read("\xEF\xBB\xBF# note: x\r\n\r\ntime [s],angle [rad]\r\n0,1\r\n\r\n   \r\n1,2.5\r\n2,3");
  EXPECT_EQ(values(run, "time"), (std::vector<double>{0, 1, 2}));
  EXPECT_EQ(values(run, "angle"), (std::vector<double>{1, 2.5, 3}));
  EXPECT_EQ(run.meta("note"), "x");
}

TEST(CsvReader, understands_quoted_headers) {
  const Recording run = read("\"time [s]\",\"odd, \"\"name\"\" [V]\",\"angle\" [rad]\n0,1,2\n");
  EXPECT_EQ(values(run, "odd, \"name\""), (std::vector<double>{1}));
  EXPECT_EQ(values(run, "angle"), (std::vector<double>{2}));
}

TEST(CsvReader, keeps_columns_it_does_not_know_with_or_without_a_unit) {
  const Recording run = read("time [s],motor current [mA],state,power [N m rad/s],gain []\n0,5,1,2,3\n");
  EXPECT_EQ(run.column("motor current").unit, "A");
  EXPECT_EQ(values(run, "motor current")[0], 5 * 1e-3);
  EXPECT_EQ(run.column("state").unit, "");
  EXPECT_EQ(run.column("gain").unit, "");
  EXPECT_EQ(run.column("power").unit, "m2 kg s-3 rad");
}

TEST(CsvReader, maps_a_foreign_header_without_editing_the_file) {
  const std::string text = "Time (s);Joint Pos (deg);Druck 1 [bar];x\n0,0;180,0;2,5;7\n";
  const Recording run =
      read(text, with_maps({"time=Time (s):s", "angle=\"Joint Pos (deg)\":deg", "p1=Druck 1"}));
  EXPECT_EQ(values(run, "angle"), (std::vector<double>{180 * (isac::kPi / 180)}));
  EXPECT_EQ(values(run, "p1"), (std::vector<double>{2.5e5}));
  EXPECT_EQ(run.column("x").unit, "");
}

TEST(CsvReader, lets_a_map_give_the_unit_that_a_header_writes_in_its_own_way) {
  EXPECT_EQ(
      values(read("t [sec],w [Grad]\n0,90\n1,90\n", with_maps({"time=t:s", "angle=w:deg"})), "angle")[1],
      90 * (isac::kPi / 180));
  EXPECT_EQ(error_of("time [s],w [deg]\n0,90\n", with_maps({"angle=w:rad"})).code(), "map_unit_contradicts");
  EXPECT_EQ(values(read("time [s],w [deg]\n0,90\n", with_maps({"angle=w [deg]:deg"})), "angle")[0],
            90 * (isac::kPi / 180));
}

TEST(CsvReader, says_which_headers_there_are_when_a_map_names_none_of_them) {
  const Error error = error_of("time [s],Pos (deg)\n0,1\n", with_maps({"angle=Position:deg"}));
  EXPECT_EQ(error.code(), "map_header_missing");
  EXPECT_NE(error.text().find("'Pos (deg)'"), std::string::npos) << error.text();
}

TEST(CsvReader, reads_maps_from_the_command_line) {
  const auto quoted = parse_column_map("angle=\"Joint: Pos (deg)\":deg");
  EXPECT_EQ(quoted.name, "angle");
  EXPECT_EQ(quoted.header, "Joint: Pos (deg)");
  EXPECT_EQ(quoted.unit, "deg");
  const auto bare = parse_column_map("p1=Druck 1:kg/cm2");
  EXPECT_EQ(bare.header, "Druck 1");
  EXPECT_EQ(bare.unit, "kg/cm2");
  EXPECT_EQ(parse_column_map("p1=Druck").unit, "");
}

TEST(CsvReader, refuses_maps_that_are_no_maps_as_a_wrong_call) {
  for (const char* text : {"", "angle", "=x:deg", "angle=", "angle=:deg", "angle=x:", "angle=\"x:deg",
                           "angle=\"x\"deg", "angle=\"x\":", "angle=\"\":deg"}) {
    try {
      (void)parse_column_map(text);
      ADD_FAILURE() << text;
    } catch (const Error& error) {
      EXPECT_EQ(error.kind(), ErrorKind::kUsage) << text;
      EXPECT_EQ(error.code(), "map_malformed") << text;
      EXPECT_NE(error.text().find("write it like"), std::string::npos) << text;
    }
  }
  for (const auto& [text, code] :
       {std::pair{"angle=x:bar", "unit_wrong"}, std::pair{"angle=x:furlong", "unit_unknown"}}) {
    try {
      (void)parse_column_map(text);
      ADD_FAILURE() << text;
    } catch (const Error& error) {
      EXPECT_EQ(error.code(), code);
      EXPECT_NE(error.text().find("rad, deg or turn"), std::string::npos);
    }
  }
}

TEST(CsvReader, needs_time_unless_told_otherwise) {
  EXPECT_EQ(error_of("p1 [bar],F1 [N]\n1,2\n").code(), "column_missing");
  EXPECT_EQ(read("p1 [bar],F1 [N]\n1,2\n1,2\n", with_maps({}, false)).rows(), 2U);
}

TEST(CsvReader, joins_the_values_of_a_repeated_key_and_takes_remarks_behind_the_rows) {
  const Recording run = read("# note: a\n# note: b\ntime [s]\n0\n# event: stop\n1\n# closed: 2003-05-01\n");
  EXPECT_EQ(run.meta("note"), "a; b");
  EXPECT_EQ(run.meta("event"), "stop");
  EXPECT_EQ(run.meta("closed"), "2003-05-01");
  EXPECT_EQ(run.rows(), 2U);
}

TEST(CsvReader, hashes_the_bytes_of_the_file) {
  const std::string text = "time [s]\n0\n1\n";
  EXPECT_EQ(read(text).sha256, isac::record::sha256_hex(text));
  ReadOptions options;
  options.hash = false;
  EXPECT_EQ(read(text, options).sha256, "");
}

// A log whose writer was killed.
const char* const kTornLog = "# log: append-only\ntime [s],angle [rad]\n0,1\n1,2\n2,3";

TEST(CsvReader, drops_the_torn_last_line_of_a_log_that_was_not_closed_and_says_so) {
  const Recording run = read(kTornLog);
  EXPECT_EQ(values(run, "time"), (std::vector<double>{0, 1}));
  EXPECT_EQ(run.meta("torn_line"), "5");
  EXPECT_EQ(run.sha256, isac::record::sha256_hex(kTornLog)) << "the hash is of all bytes, the torn ones too";
}

TEST(CsvReader, drops_nothing_of_a_log_that_was_closed_or_ends_with_a_whole_line) {
  EXPECT_EQ(read(std::string(kTornLog) + "\n").rows(), 3U);
  EXPECT_FALSE(read(std::string(kTornLog) + "\n").metadata.contains("torn_line"));
  EXPECT_EQ(read("# log: append-only\n# closed: 2003-05-01\ntime [s],angle [rad]\n0,1\n2,3").rows(), 2U);
}

TEST(CsvReader, never_takes_a_torn_first_row_for_a_whole_one) {
  const Error error = error_of("# log: append-only\ntime [s],angle [rad]\n0,1");
  EXPECT_EQ(error.code(), "no_rows");
  EXPECT_EQ(error.place().line, 3);
}

TEST(CsvReader, refuses_a_file_that_ends_in_the_middle_of_a_row) {
  const Error error = error_of("time [s],angle [rad],p1 [bar]\n0,1,2\n1,2");
  EXPECT_EQ(error.code(), "line_cut_off");
  EXPECT_EQ(error.place().line, 3);
  EXPECT_EQ(error_of("time [s],angle [rad]\n0").code(), "line_cut_off");
  EXPECT_EQ(error_of("time [s],angle [rad]\n0\n1").code(), "row_length")
      << "the first short row is whole, though too short";
}

TEST(CsvReader, refuses_a_line_of_more_than_a_megabyte_in_the_head_and_among_the_rows) {
  const std::string spaces((std::size_t{1} << 20U) + 10, ' ');
  const std::string cells = "time [s],angle [rad]\n0,1\n1," + spaces;
  for (const std::string& text :
       {"# note: " + spaces + "x\ntime [s]\n0\n", spaces, cells + "2\n", cells + "2", cells}) {
    EXPECT_EQ(error_of(text).code(), "line_too_long");
  }
  const std::string below(std::size_t{1} << 19U, ' ');
  EXPECT_EQ(read("time [s],angle [rad]\n0,1\n1," + below + "2\n").rows(), 2U);
}

TEST(CsvReader, refuses_more_columns_and_metadata_than_a_recording_can_have) {
  std::string header = "time [s]";
  for (int i = 0; i < 5000; ++i) header += ",c" + std::to_string(i);
  EXPECT_EQ(error_of(header + "\n").code(), "column_too_many");
  std::string notes;
  for (int i = 0; i < 1200; ++i) notes += "# note: " + std::string(1000, 'x') + "\n";
  EXPECT_EQ(error_of(notes + "time [s]\n0\n").code(), "metadata_too_long");
}

TEST(CsvReader, takes_iso_times_and_refuses_others) {
  for (const char* good : {"2003-05-01", "2003-05-01T14:30", "2003-05-01 14:30:05", "2003-05-01T14:30:05.25Z",
                           "2003-05-01T14:30:05+02:00", "2003-05-01T14:30-0500", "2016-12-31T23:59:60Z"}) {
    EXPECT_EQ(read("# started: " + std::string(good) + "\ntime [s]\n0\n").meta("started"), good);
  }
  for (const char* bad : {"1.5.2003", "2003-13-01", "2003-05-32", "2003-05-01T25:00", "2003-05-01T14:30:05.",
                          "2003-05-01T14", "yesterday", "", "2003-05-01T14:30Zulu"}) {
    EXPECT_EQ(error_of("# started: " + std::string(bad) + "\ntime [s]\n0\n").code(), "started_not_iso8601")
        << bad;
  }
}

TEST(CsvReader, refuses_a_misspelt_experiment_but_keeps_new_ones) {
  for (const char* bad :
       {"constant_pressure", "Constant-Angle", "constant-presure", "closed loop", "PCU-step"}) {
    EXPECT_EQ(error_of("# experiment: " + std::string(bad) + "\ntime [s]\n0\n").code(), "experiment_misspelt")
        << bad;
  }
  for (const char* good : {"free", "pose", "calibration", "muscle-isometric"}) {
    EXPECT_EQ(read("# experiment: " + std::string(good) + "\ntime [s]\n0\n").meta("experiment"), good);
  }
}

TEST(CsvReader, refuses_files_that_cannot_be_opened_or_read) {
  const auto code = [](const char* path) {
    try {
      (void)isac::record::read_recording(path);
    } catch (const Error& error) {
      EXPECT_EQ(error.kind(), ErrorKind::kBadInput);
      EXPECT_EQ(error.place().file, path);
      return error.code();
    }
    return std::string("none");
  };
  EXPECT_EQ(code("/nonexistent/run.csv"), "file_missing");
  EXPECT_EQ(code("/etc/passwd/run.csv"), "file_missing");
  EXPECT_EQ(code("/tmp"), "file_is_directory");
  EXPECT_EQ(code("/proc/self/mem"), "file_unreadable")
      << "reading address 0 of this process gives an input error";
  EXPECT_EQ(code("/dev/null"), "file_empty");
}

TEST(CsvReader, counts_columns_in_characters) {
  const Error error = error_of("time [s],Größe,p1 [furlong]\n0,1,2\n");
  EXPECT_EQ(error.code(), "unit_unknown");
  EXPECT_EQ(error.place().column, 16) << "ö and ß are one character each";
}

}  // namespace
