#!/usr/bin/env bash
# Checks the code and runs the tests, in jobs side by side: `.ci/test.sh`, or `.ci/test.sh JOB...` for some of them.  One job more
# than processors, because tests also wait.  What a job printed is shown when it has ended; the last line counts the tests of all
# jobs.
#
# Tests with the mark `long` are larger forms of claims that other tests have too; `TEST_LONG=1 .ci/test.sh` runs them as well.
# A test that fails is run once more, by itself and with the same seed, where at most MOST_REPEATED of a job failed: a fault of the
# code fails again, a machine that stood still for a moment does not.  One that passes then is named as unsteady at the end.
#
# Few jobs: each loads the libraries again, 3 to 5 seconds.
#
# The tests of a folder keep their order.  Those of OpenGL share a context, and want no other's objects collected meanwhile.
set -uo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
unset PYTHONDONTWRITEBYTECODE  # the tests start some hundred processes: each would compile the modules that it imports again
# Small pictures, and other jobs have the other processors: more threads of the software driver cost a tenth.
export LP_NUM_THREADS=1

JOBS=(unit-1 window-1 window-2 gl unit-3 unit-2 rest lint hostile)  # the longest first, so that the last ones end together
MARKS=(-m "not long")
if [[ -n ${TEST_LONG:-} ]]; then
    MARKS=()
    export POINTGLASS_RANDOM_ACTIONS=${POINTGLASS_RANDOM_ACTIONS:-400}
fi

MOST_REPEATED=3

# In CI the seed is fixed: what failed there fails in any clone.  Every run elsewhere draws another.
CI_SEED=192401465
fresh_seed() {
    if [[ ${CI:-} == true ]]; then
        echo $CI_SEED
    else
        echo $((RANDOM << 15 | RANDOM))
    fi
}

tests() {
    local first="$TEST_LOGS/$JOB.first" second="$TEST_LOGS/$JOB.second" status
    local seed=${POINTGLASS_SEED:-$(fresh_seed)}
    run() { POINTGLASS_SEED=$seed .venv/bin/python -m pytest -q -o cache_dir="$TEST_LOGS/$JOB.cache" "${MARKS[@]}" "$@"; }
    run "$@" >"$first" 2>&1
    status=$?
    if ((status != 1 || $(grep -cE '^(FAILED|ERROR) ' "$first") > MOST_REPEATED)); then
        cat "$first"
        return "$status"
    fi
    run --last-failed --last-failed-no-failures none "$@" >"$second" 2>&1
    status=$?
    if ((status == 0)); then
        grep -E '^(FAILED|ERROR) ' "$first" | sed -E 's/^[A-Z]+ /unsteady: /' >>"$TEST_LOGS/unsteady"
        sed -E 's/^/first run: /' "$first"
        tail -1 "$first" | sed -E 's/([0-9]+) (failed|errors?)/\1 passed/g'  # as they ended, for the sum
    else
        cat "$first"
        sed 's/^/second run: /' "$second"
    fi
    return "$status"
}

# Pyright, which takes a minute and a half of a processor and keeps nothing: not again where nothing that it reads has changed
# since it found nothing.  `make lint` always runs it.
types() {
    local clean=.venv/.types-clean state
    state=$(find viewer model tests pointglass.py pyproject.toml .venv/.stamp -type f ! -name '*.pyc' ! -name '*.nb[ic]' -print0 |
        sort -z | xargs -0 sha256sum | sha256sum)
    if [[ $(cat "$clean" 2>/dev/null) == "$state" ]]; then
        echo "pyright: no change since it found nothing"
        return
    fi
    .venv/bin/python -m pyright --warnings && echo "$state" >"$clean"
}

run_job() {
    case $1 in
        lint) .venv/bin/python -m ruff check . && types ;;
        unit-1) tests tests/unit/{grid,interface,picture,program,readers,render} ;;
        unit-2) tests tests/unit/{bench,commands,common,exporting} ;;
        unit-3) tests tests/unit/{lab,model,window,work} ;;
        window-1) tests tests/window/test_[a-q]*.py ;;
        window-2) tests tests/window/test_[r-z]*.py ;;
        gl) tests tests/gl ;;
        hostile) tests tests/hostile ;;
        rest) tests tests --ignore=tests/unit --ignore=tests/window --ignore=tests/gl --ignore=tests/hostile ;;
        *) echo "no job is named $1; there are ${JOBS[*]}"; return 2 ;;
    esac
}

# Runs one job, and prints its output as a whole.
logged_job() {
    local outcome=passed
    JOB=$1 run_job "$1" >"$TEST_LOGS/$1.log" 2>&1 || outcome="FAILED, exit code $?"
    {
        flock 9
        echo "--- $1: $outcome, $SECONDS s"
        cat "$TEST_LOGS/$1.log"
        [[ $outcome == passed ]] || echo "$1" >>"$TEST_LOGS/failed"
    } 9>"$TEST_LOGS/lock"
}

# The closing lines of pytest in all logs, added up to one.
sum_up() {
    local log
    for log in "$TEST_LOGS"/*.log; do
        grep -E '^(=+ )?[0-9]+ [a-z]+.* in [0-9.]+s' "$log" | tail -1
    done | awk -v seconds="$SECONDS" '
        {
            sub(/ in [0-9.]+s.*/, "")
            gsub(/[=,]/, "")
            for (i = 1; i < NF; i += 2) { sub(/s$/, "", $(i + 1)); count[$(i + 1)] += $i }
        }
        END {
            words = split("failed passed skipped deselected xfailed xpassed warning error", order, " ")
            for (i = 1; i <= words; i++)
                if (count[order[i]]) line = line (line ? ", " : "") count[order[i]] " " order[i]
            print (line ? line : "no tests ran") " in " seconds " s"
        }'
}

if [[ -n ${TEST_LOGS:-} ]]; then  # started below
    logged_job "$1"
    exit
fi
TEST_LOGS=$(mktemp -d)
export TEST_LOGS
trap 'rm -rf "$TEST_LOGS"' EXIT
status=0
printf '%s\n' "${@:-${JOBS[@]}}" | xargs -P "$(($(nproc) + 1))" -n 1 .ci/test.sh || status=1
if [[ -e $TEST_LOGS/failed ]]; then
    status=1
    echo "failed: $(paste -sd ' ' "$TEST_LOGS/failed")"
fi
if [[ -e $TEST_LOGS/unsteady ]]; then
    echo "Tests that failed, and passed when they were run once more with the same seed:"
    sort "$TEST_LOGS/unsteady"
fi
sum_up
exit $status
