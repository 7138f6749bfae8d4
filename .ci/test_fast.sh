#!/usr/bin/env bash
# The unit tests of some rooms, and the rules of the layout: `.ci/test_fast.sh ROOM...`.  Without a name those of the rooms whose
# files differ from the last commit.  For the change of one room under a minute on two processors, whose files are shared out to as
# many processes; `make test` runs everything.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
unset PYTHONDONTWRITEBYTECODE  # the tests start processes: each would compile the modules that it imports again

# The folder of tests/unit for a changed file; nothing for a file without unit tests of its own.
tests_of() {
    case $1 in
        tests/unit/*/*) echo "$1" | cut -d/ -f3 ;;
        viewer/commands/exporting/*) echo exporting ;;
        viewer/preprocess/* | viewer/stream/*) echo grid ;;
        viewer/*/*) echo "$1" | cut -d/ -f2 ;;
        viewer/* | pointglass.py | README.md | .github/* | .ci/*) echo program ;;
        model/common/*) echo common ;;
        model/data/* | model/synth/* | model/train/* | model/evaluation/*) echo lab ;;
        model/*) echo model ;;
        shaders/*) echo render ;;
    esac
}

rooms=("$@")
if [[ ${#rooms[@]} -eq 0 ]]; then
    mapfile -t rooms < <({ git diff --name-only HEAD; git ls-files --others --exclude-standard; } | while read -r file; do
        tests_of "$file"
    done | sort -u)
fi
folders=(tests/unit/program/test_architecture.py)
for room in "${rooms[@]}"; do
    if [[ ! -d tests/unit/$room ]]; then
        echo "no tests/unit/$room; there are $(cd tests/unit && ls -d */ | tr -d '/' | paste -sd ' ')"
        exit 2
    fi
    folders+=("tests/unit/$room")
done

mapfile -t files < <(find "${folders[@]}" -name 'test_*.py' | sort -u)
workers=$(($(nproc) < 4 ? $(nproc) : 4))
logs=$(mktemp -d)
trap 'rm -rf "$logs"' EXIT
running=()
for ((worker = 0; worker < workers && worker < ${#files[@]}; worker++)); do
    share=()
    for ((i = worker; i < ${#files[@]}; i += workers)); do share+=("${files[i]}"); done
    .venv/bin/python -m pytest -q -m "not slow and not long" "${share[@]}" >"$logs/$worker" 2>&1 &
    running+=($!)
done
status=0
for worker in "${!running[@]}"; do
    code=0
    wait "${running[worker]}" || code=$?
    [[ $code == 0 || $code == 5 ]] || status=1  # 5: all of its tests are slow
    cat "$logs/$worker"
done
exit $status
