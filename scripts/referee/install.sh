#!/usr/bin/env bash
# Installs siconos for the system's Python (Debian 12 or later, Ubuntu 23.04 or later).
set -euo pipefail
as_root=()
[ "$(id -u)" -eq 0 ] || as_root=(sudo)
"${as_root[@]}" apt-get update
"${as_root[@]}" apt-get install --yes python3-siconos
dpkg-query --showformat='${Package} ${Version}\n' --show python3-siconos
