// isac-identify: parameters of joints, valve units, muscles and sensors from recordings
// (docs/reference/isac-identify.md).
#include <CLI/CLI.hpp>
#include <string>
#include <utility>
#include <vector>

#include "common/program.hpp"
#include "identify/commands.hpp"

int main(int argc, char** argv) {
  using namespace isac::apps;
  CLI::App app{"Identifies joints, valve units, muscles and sensors from recordings.", "isac-identify"};
  app.set_version_flag("--version", ISAC_VERSION);
  app.require_subcommand(1);

  std::string json_path;
  std::vector<Body> bodies;
  for (auto* add : {add_joint, add_motion, add_pcu, add_muscle, add_masses, add_calibrate, add_check,
                    add_export, add_diff}) {
    bodies.push_back(add(app, json_path));
  }
  return run_program(app, argc, argv, json_path, [&app, &bodies] {
    const auto all = app.get_subcommands([](CLI::App*) { return true; });
    for (std::size_t i = 0; i < all.size(); ++i) {
      if (all[i]->parsed()) return bodies[i]();
    }
    return 2;
  });
}
