/// @file
/// Published tables as data (`isac.data/1`, folder data/): numbers with units, origin and errata, and what can be asked of them.
///
/// A file has title, origin, licence, notes, errata, the unit of each number column under [units], and [[row]]s. A column
/// `value` may have its unit in the same row's `unit`. Numbers are kept as printed; `si` converts.
/// Threads: values; const access is safe. Throws isac::Error (bad input) with file, line and column.
/// Source: seed tables 4.1, 4.3, 6.1, 6.2, C.1 to C.5, E.1 to E.7, F.1, F.2; format in docs/formats.md.
/// Example: `double A = read_data("data/actuator_parameters.toml").number(0, "A");`
#pragma once

#include <filesystem>
#include <limits>
#include <map>
#include <string>
#include <string_view>
#include <variant>
#include <vector>

namespace isac::record {

using DataCell = std::variant<double, std::string>;

struct DataTable {
  std::string file, title, origin, licence;
  std::vector<std::string> notes, errata;
  std::map<std::string, std::string> units;           ///< of the number columns
  std::vector<std::map<std::string, DataCell>> rows;  ///< a cell that the source leaves open is absent

  /// The number as printed, in its column's unit; NaN where the source leaves the cell open. Text is an error.
  [[nodiscard]] double number(std::size_t row, const std::string& column) const;
  /// The same in SI.
  [[nodiscard]] double si(std::size_t row, const std::string& column) const;
  /// The text, empty where the cell is open. A number is an error.
  [[nodiscard]] std::string text(std::size_t row, const std::string& column) const;
  /// The first row whose `column` holds `value`; an error that names both when there is none.
  [[nodiscard]] std::size_t find(const std::string& column, std::string_view value) const;
};

[[nodiscard]] DataTable read_data(const std::filesystem::path& path);
[[nodiscard]] DataTable parse_data(const std::string& text, const std::string& file_name);

/// A muscle of the data sheets (C.1, C.2, F.1), SI.
struct Muscle {
  std::string maker;  ///< "Bridgestone", "Shadow", "Festo"
  std::string type;   ///< "#18", "MAS-40"
  double usable_force =
      0;  ///< N; Rubbertuators: kUsableShareOfStrength of the strength, others: the greatest pull
  double length_min = 0;       ///< m; equal to length_max where it comes in one length
  double length_max = 0;       ///< m
  double contraction_max = 0;  ///< share of the length
  double pressure_max = 0;     ///< Pa
};

/// What a joint asks of one muscle, from tables 6.1 and F.2, SI.
struct JointDemand {
  std::string joint;
  double muscle_length = 0;  ///< m, the place there is
  double force = 0;  ///< N; B · 2 kg/cm²: what one muscle pulls when the other is slack at the validity limit
  double contraction = 0;  ///< share; chain-wheel radius · 3/8 π over the length, either way from the middle
};

/// How much of its strength a Rubbertuator is asked for. The source does not say: two is the usual safety of a part in
/// repeated load, and table F.2's own choice follows for any share between 0.44 and 0.67.
inline constexpr double kUsableShareOfStrength = 0.5;

struct MuscleFit {
  enum class Verdict { kServes, kPartly, kTooWeak };
  Muscle muscle;
  double share = 0;                     ///< usable force over the joint's demand
  Verdict verdict = Verdict::kTooWeak;  ///< serves: share ≥ 1; partly: ≥ 1/2 of the torque range
  bool first_choice =
      false;                ///< of its maker: the weakest that serves, else the strongest that serves partly
  bool length_fits = true;  ///< the length it comes in is that of the place, within 10 %
  std::string sentence;
};

/// All muscles of `folder` (rubbertuators.toml, air_muscles.toml, fluidic_muscles.toml), in the files' order.
[[nodiscard]] std::vector<Muscle> read_muscles(const std::filesystem::path& folder,
                                               double usable_share_of_strength = kUsableShareOfStrength);
/// One per row of joint_muscles.toml, with B and the wheel of actuator_parameters.toml.
[[nodiscard]] std::vector<JointDemand> read_joint_demands(const std::filesystem::path& folder);

/// Which muscle can serve which joint: every muscle judged for one joint, in the order of `muscles`.
[[nodiscard]] std::vector<MuscleFit> muscles_for_joint(const JointDemand& demand,
                                                       const std::vector<Muscle>& muscles);

}  // namespace isac::record
