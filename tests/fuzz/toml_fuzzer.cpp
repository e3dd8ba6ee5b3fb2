// The TOML readers hold for any bytes: they read them, and what they write then reads back and is written the same; or they
// throw one isac::Error in one line with a place.
#include <cstdint>
#include <cstdlib>
#include <string>

#include "isac/core/error.hpp"
#include "isac/record/data_tables.hpp"
#include "isac/record/model_file.hpp"
#include "isac/record/params.hpp"
#include "isac/record/plan_file.hpp"
#include "isac/record/rig.hpp"

namespace {

void require(bool holds) {
  if (!holds) std::abort();
}

template <typename Read>
void refuses_in_one_line(const Read& read) {
  try {
    read();
  } catch (const isac::Error& error) {
    require(error.kind() == isac::ErrorKind::kBadInput && !error.code().empty());
    require(error.text().find_first_of("\n\r") == std::string::npos && error.text().size() < 1000);
    require(error.place().file == "fuzz.toml" && error.place().line >= 0 && error.place().column >= 0);
  }
}

template <typename Parse, typename Format>
void round_trip(const std::string& text, const Parse& parse, const Format& format) {
  std::string once;
  refuses_in_one_line([&] { once = format(parse(text, "fuzz.toml")); });
  if (once.empty()) return;
  require(format(parse(once, "written.toml")) ==
          once);  // an isac::Error here ends the program: writers must be readable
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const std::string text(reinterpret_cast<const char*>(data), size);
  round_trip(text, isac::record::parse_rig, isac::record::format_rig);
  round_trip(text, isac::record::parse_model, isac::record::format_model);
  round_trip(text, isac::record::parse_params, isac::record::format_params);
  round_trip(text, isac::record::parse_plan, isac::record::format_plan);
  refuses_in_one_line([&text] { (void)isac::record::parse_data(text, "fuzz.toml"); });
  return 0;
}
