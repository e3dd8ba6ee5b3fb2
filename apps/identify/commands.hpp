/// @file
/// The subcommands of isac-identify: each adds its words to the program and returns what runs when it is
/// called.
#pragma once

#include <functional>
#include <string>

namespace CLI {
class App;
}

namespace isac::apps {

/// What a subcommand runs after the call was parsed; returns the exit code.
using Body = std::function<int()>;

/// `json_path` outlives the call; every subcommand's --json writes into it.
Body add_joint(CLI::App& program, std::string& json_path);
Body add_motion(CLI::App& program, std::string& json_path);
Body add_pcu(CLI::App& program, std::string& json_path);
Body add_muscle(CLI::App& program, std::string& json_path);
Body add_masses(CLI::App& program, std::string& json_path);
Body add_calibrate(CLI::App& program, std::string& json_path);
Body add_check(CLI::App& program, std::string& json_path);
Body add_export(CLI::App& program, std::string& json_path);
Body add_diff(CLI::App& program, std::string& json_path);

}  // namespace isac::apps
