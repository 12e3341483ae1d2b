#!/bin/sh
# Prints the table of benches/notes/performance.md: our kernels beside those of other programs, which it
# installs into target/peers. With a picture of people, and a log of colour and depth images, it adds
# the detectors that look at windows. Run it on a machine that does nothing else.
# Usage, from the folder of the workspace: benches/peers/run.sh [PICTURE [LOG]]
set -eu
cd "$(dirname "$0")/../.."
venv=target/peers
test -x "$venv/bin/python" || python3 -m venv "$venv"
"$venv/bin/pip" install --quiet --disable-pip-version-check \
    'numpy<3' 'scipy<2' 'lap<0.6' 'opencv-contrib-python-headless<5' filterpy 'supervision<1' rich
# Without what they depend on: they ask for other builds of OpenCV, which is the one above.
"$venv/bin/pip" install --quiet --disable-pip-version-check --no-deps 'trackers<3' trackeval
export OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1
"$venv/bin/python" benches/peers/kernels.py
test $# -eq 0 || "$venv/bin/python" benches/peers/windows_opencv.py "$@"
