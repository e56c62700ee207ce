#!/usr/bin/env bash
# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

# Do what a newcomer does on a fresh Debian: install what the README names, clone, and type make demo
# and make test. The last commit is what is cloned.
#
# usage: debian.sh SUITE [COMMANDS]     (trixie: Debian 13; bookworm: Debian 12)
# Needed: root, debootstrap, git, and 6 GB below TMPDIR.
# DEBIAN_MIRROR is where packages come from; without it, where apt here has them from.
set -euo pipefail

checkout=$(cd "$(dirname "${BASH_SOURCE[0]}")/../.." && pwd)
suite=$1
commands=${2:-$'make demo\nmake test'}

fail() {
    echo "error: $1" >&2
    exit 1
}
[ "$(id -u)" = 0 ] || fail 'only root can make another Debian: sudo make test-debian13'
for program in debootstrap git unshare; do
    command -v "$program" >/dev/null || fail "$program is not installed (apt install $program)"
done
mirror=${DEBIAN_MIRROR:-$(apt-get indextargets --format '$(ORIGIN) $(REPO_URI)' 2>/dev/null |
    sed -n 's,^Debian \(.*/debian/\?\)$,\1,p' | sort -u | head -n 1)}
[ -n "$mirror" ] || fail 'DEBIAN_MIRROR must say where Debian packages come from'

debian=$(mktemp -d)/debian
# Mounts are those of a namespace that ends with its process: nothing of this machine lies below.
trap 'rm -rf --one-file-system "${debian%/*}"' EXIT
echo "making a Debian $suite in $debian (a minute)"
# The release after the next may be younger than this debootstrap: all have the script of sid.
script=/usr/share/debootstrap/scripts/sid
debootstrap --variant=minbase --include=ca-certificates "$suite" "$debian" "$mirror" "$script" \
    >"${debian%/*}/log" || { tail "${debian%/*}/log"; fail 'debootstrap failed'; }
# A network may have its own names and certificates.
cp /etc/resolv.conf /etc/hosts "$debian/etc/"
cp /etc/ssl/certs/ca-certificates.crt "$debian/etc/ssl/certs/"
git -c safe.directory='*' clone --quiet "$checkout" "$debian/home/newcomer/box_contact_ros"

inside=$(cat <<'INSIDE'
mount -t proc proc "$debian/proc"
mount --rbind /dev "$debian/dev"
mount -t tmpfs tmpfs "$debian/dev/shm"
chroot "$debian" bash -euo pipefail -c '
    export DEBIAN_FRONTEND=noninteractive
    # A mirror may be weeks behind.
    apt-get -o Acquire::Check-Valid-Until=false update >/var/log/newcomer
    apt-get install -y git make g++ python3-dev python3-venv >>/var/log/newcomer
    useradd --create-home --shell /bin/bash newcomer 2>/dev/null
    chown -R newcomer: /home/newcomer'
settings=$(env | grep -E '^(PIP_|https?_proxy=)' | grep -v '^PIP_FIND_LINKS=' || true)
readarray -t settings <<<"$settings"
chroot --userspec newcomer "$debian" env -i HOME=/home/newcomer USER=newcomer LANG=C.UTF-8 \
    PATH=/usr/local/bin:/usr/bin:/bin ${settings[0]:+"${settings[@]}"} bash -euo pipefail -c '
    cd ~/box_contact_ros
    . /etc/os-release
    echo "$PRETTY_NAME, $(python3 --version), $(nproc) processors, as $(id -un)"
    while read -r command; do
        echo "\$ $command"
        SECONDS=0
        bash -c "$command" </dev/null
        echo "($SECONDS s)"
    done <<<"$0"' "$commands"
INSIDE
)
debian=$debian commands=$commands unshare --mount --pid --fork --kill-child \
    bash -euo pipefail -c "$inside" </dev/null
echo "done: Debian $suite"
