#!/usr/bin/env bash
# Gate K-6: the four tools of compute-sanitizer over every CUDA kernel, on little work.
#
#   bench/sanitize.sh [memcheck|racecheck|initcheck|synccheck ...]
#
# Needs a GPU, a build with CUDA kernels, and compute-sanitizer, which comes with the CUDA toolkit.
# SANITIZER names it where it is not on PATH; further arguments of pytest go into PYTEST_ADDOPTS.
# The exit code is 0 if every tool reports no error and every test passes.
set -uo pipefail
cd "$(dirname "$0")/.."

sanitizer=${SANITIZER:-$(command -v compute-sanitizer || echo /usr/local/cuda/bin/compute-sanitizer)}
if [ ! -x "$sanitizer" ]; then
  echo "sanitize.sh: $sanitizer is not there: set SANITIZER to compute-sanitizer" >&2
  exit 2
fi
tools=("$@")
[ $# -gt 0 ] || tools=(memcheck racecheck initcheck synccheck)

# Every tensor has memory of its own, so that reading beyond it is seen.
export PYTORCH_NO_CUDA_MEMORY_CACHING=1 OMP_NUM_THREADS=1

status=0
for tool in "${tools[@]}"; do
  options=(--tool "$tool" --error-exitcode 86 --print-limit 20)
  case $tool in
    memcheck) options+=(--report-api-errors no) ;;  # torch asks the driver for what it may not have
    racecheck | synccheck) options+=(--kernel-name kns=granpinn) ;;
    # initcheck must see the kernels of torch too: they write what ours read
  esac
  begin=$SECONDS
  "$sanitizer" "${options[@]}" "${PYTHON:-python3}" -m pytest -q -p no:cacheprovider \
    -o timeout=600 tests/kernels/test_small_work.py
  code=$?
  echo "sanitize.sh: $tool: exit code $code, $((SECONDS - begin)) s"
  [ $code -eq 0 ] || status=1
done
exit $status
