#!/bin/sh
# The blind benchmark in one command: hides every effect of the catalogue (clear, faint, and clear with its own name taken out of the catalogue), two at
# once, effects of no catalogue, and nothing, under every kind of noise; asks isac-explain and the usual methods; writes the tables (false alarms, gap
# closed, reliability, confusion) and the reliability diagram into docs/explain.md.
#
#   sh tests/blind/benchmark.sh SEED [WORDS]      WORDS go to every blind_run: --noise white --effect leak,creep,root_damping
#
# Some three and a half hours on two cores, by what single tiers took; started again it goes on where it stopped. Noise of a real residual needs ISAC_REAL_DATA.
#   BIN=build/dev/bin   the programs          RESULTS=build/blind/SEED   a line for each dataset
#   PAGE=docs/explain.md                      EXPLAIN, BASELINES         other programs to be asked
#   EMPTY=500 PAIRS=24  for each kind of noise      EACH=1   for each effect and kind of noise
set -eu
cd "$(dirname "$0")/../.."
case ${1-} in
  '' | *[!0-9]*) sed -n '2,11s/^# \{0,1\}//p' tests/blind/benchmark.sh >&2; exit 2 ;;
esac
seed=$1; shift
bin=${BIN-build/dev/bin}
results=${RESULTS-build/blind/$seed}
explain=${EXPLAIN-$bin/isac-explain}
baselines=${BASELINES-$bin/blind_baselines}
jobs=$(nproc 2>/dev/null || echo 2)
mkdir -p "$results"

ask() { # tier, count, words for blind_run
  tier=$1; count=$2; shift 2
  "$bin/blind_run" --tier "$tier" --count "$count" --seed "$seed" --jobs "$jobs" --explain "$explain" --results "$results/$tier.jsonl" "$@" -- --threads 1
}

ask clear "${EACH-1}" --oracle --twin --baselines "$baselines" "$@"
ask faint "${EACH-1}" --oracle "$@"
ask leave-one-out "${EACH-1}" --oracle "$@"
ask outside "${EACH-1}" --baselines "$baselines" "$@"
ask pair "${PAIRS-24}" --oracle "$@"
ask none "${EMPTY-500}" "$@"
few=${EMPTY-500}
[ "$few" -le 11 ] || few=11
"$bin/blind_run" --tier none --count "$few" --seed "$seed" --jobs "$jobs" --baselines "$baselines" --results "$results/none_baselines.jsonl" "$@"
"$bin/blind_score" --into "${PAGE-docs/explain.md}" "$results"/*.jsonl
