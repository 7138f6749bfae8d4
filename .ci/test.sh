#!/usr/bin/env bash
# Checks the code and runs the tests, in jobs side by side: `.ci/test.sh`, or `.ci/test.sh JOB...` for some of them.  One job more
# than processors, because tests also wait.  What a job printed is shown when it has ended; the last line counts the tests of all
# jobs.
#
# Tests with the mark `long` are larger forms of claims that other tests have too; `TEST_LONG=1 .ci/test.sh` runs them as well.
# Few jobs: each loads the libraries again, 3 to 5 seconds.
#
# The tests of a folder keep their order.  Those of OpenGL share a context, and want no other's objects collected meanwhile.
set -uo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
unset PYTHONDONTWRITEBYTECODE  # the tests start some hundred processes: each would compile the modules that it imports again
# Small pictures, and other jobs have the other processors: more threads of the software driver cost a tenth.
export LP_NUM_THREADS=1

JOBS=(window unit-1 unit-2 unit-3 gl rest hostile lint)  # the longest first, so that the last ones end together
MARKS=(-m "not long")
if [[ -n ${TEST_LONG:-} ]]; then
    MARKS=()
    export POINTGLASS_RANDOM_ACTIONS=${POINTGLASS_RANDOM_ACTIONS:-400}
fi

tests() {
    .venv/bin/python -m pytest -q "${MARKS[@]}" "$@"
}

# Pyright, which takes a minute and a half of a processor and keeps nothing: not again where nothing that it reads has changed
# since it found nothing.  `make lint` always runs it.
types() {
    local clean=.venv/.types-clean state
    state=$(find viewer model pointglass.py pyproject.toml .venv/.stamp -type f ! -name '*.pyc' ! -name '*.nb[ic]' -print0 |
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
        window) tests tests/window ;;
        gl) tests tests/gl ;;
        hostile) tests tests/hostile ;;
        rest) tests tests --ignore=tests/unit --ignore=tests/window --ignore=tests/gl --ignore=tests/hostile ;;
        *) echo "no job is named $1; there are ${JOBS[*]}"; return 2 ;;
    esac
}

# Runs one job, and prints its output as a whole.
logged_job() {
    local outcome=passed
    run_job "$1" >"$TEST_LOGS/$1.log" 2>&1 || outcome="FAILED, exit code $?"
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
sum_up
exit $status
