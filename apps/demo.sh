#!/bin/sh
# The demo behind `./run demo`: a rig, sweeps, a fit, an explained gap, tables, a report. Usage: demo.sh <folder of programs> <folder for results>
set -eu
programs=$1
out=$2
here=$(cd "$(dirname "$0")/.." && pwd)

say() { printf '\n\033[1m== %s\033[0m\n' "$*"; }
plain() { printf '\n== %s\n' "$*"; }
[ -t 1 ] || say() { plain "$@"; }

if [ -e "$out" ] && [ ! -e "$out/.isac-demo" ]; then
  echo "'$out' exists and was not made by the demo; name another folder: ./run demo FOLDER" >&2
  exit 2
fi
rm -rf "$out"
mkdir -p "$out"
: > "$out/.isac-demo"
cp "$here/data/rigs/testbed.toml" "$out/rig.toml"

say "1 of 6  Logging the sweeps of a testbed (simulated rig, virtual time)"
"$programs/isac-log" all --card sim:seed=2003,effect=cubic_stiffness:0.4 --rig "$out/rig.toml" -o "$out/dataset"

say "2 of 6  Looking at what was recorded"
"$programs/isac-identify" check "$out"/dataset/*.csv --report "$out/signals.html"

say "3 of 6  Fitting T = A r² φ + B r Δp − C φ̇³ − D φ̇"
"$programs/isac-identify" joint "$out/dataset" -o "$out/params.toml" --report "$out/report.html" --json "$out/joint.json"
echo "(the simulated rig was built with A = -23450 N/m, B = 174.2 N cm2/kg, C = 0.0026 N m s3, D = 0.14 N m s,"
echo " and with an effect that this model does not have, which is why the fit is off and says so)"

say "4 of 6  Explaining the gap: what is missing, added, and proven on held-out runs"
"$programs/isac-explain" "$out/dataset" --rig "$out/rig.toml" -o "$out/params.toml" --report "$out/explained.html" --json "$out/explained.json"
echo "(hidden in the simulated rig was a hardening stiffness, k3 = 0.4 N m/rad3)"

say "5 of 6  Identifying the valve unit"
"$programs/isac-identify" pcu "$out"/dataset/pcu-step*.csv -o "$out/params.toml" --report "$out/valves.html"
echo "(the simulated valve unit was built with K_C = 1, T_C = 0.17 s)"

say "6 of 6  Writing the controller's tables"
"$programs/isac-identify" export "$out/params.toml" -o "$out/tables"

for made in report.html explained.html valves.html signals.html params.toml tables/isac_parameters.h tables/isac_parameters.bin; do
  [ -s "$out/$made" ] || { echo "the demo did not make $out/$made" >&2; exit 1; }
done

say "Done. Open these:"
printf '  %s\n' "$out/explained.html  what was missing: where, what, the proof" "$out/report.html   the fit, with pictures" "$out/valves.html   the valve unit" \
  "$out/signals.html  every signal of every sweep" "$out/params.toml   what every program reads" \
  "$out/tables/       C header, binary with CRC, CSV, Markdown"
