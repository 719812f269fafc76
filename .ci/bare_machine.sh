#!/usr/bin/env bash
# The two commands as a new user types them, on a bare Debian: Python 3.11, make, git and certificates.
#
#   sudo .ci/bare_machine.sh [--root FOLDER] [--keep] [--suite bookworm] [--mirror URL] [COMMAND ...]
#   .ci/bare_machine.sh --check       only tell whether this machine can
#
# It makes such a root with debootstrap in FOLDER (a new one in $TMPDIR; 8 GB), clones the checkout's HEAD
# into it and runs each COMMAND there with bash; unless others are given, `make demo`, then `make test`.
# Lent to the root, so that it can install what this machine can: apt's mirror and proxy, pip's
# configuration and the local folders that it names, the CA certificates, and ../shared; folders read-only.
# All mounts are in a mount namespace of their own, which goes with the script however that ends; then
# the folder is removed, unless --keep is said.
#
# Exit: 0; the status of the command that failed; 75 where the machine cannot make such a root, and why.
set -euo pipefail

CANNOT=75 # EX_TEMPFAIL
NEEDED_MB=8000
PLACE=/home/r2sego/checkout # in the root
BUNDLE=/etc/ssl/certs/ca-certificates.crt

HOME=${HOME:-/root}
here=$(cd "$(dirname "$0")/.." && pwd)
suite=bookworm mirror="" root="" keep="" check="" inside=""
while [ $# -gt 0 ]; do
  case $1 in
    --root) root=$2; shift 2 ;;
    --suite) suite=$2; shift 2 ;;
    --mirror) mirror=$2; shift 2 ;;
    --keep) keep=1; shift ;;
    --check) check=1; shift ;;
    --inside) inside=1; shift ;; # said by this script to itself, in its namespaces
    -h | --help) sed -n '2,/^set /s/^# \{0,1\}//p' "$0"; exit 0 ;;
    -*) echo "bare machine: no such option: $1 (see --help)" >&2; exit 2 ;;
    *) break ;;
  esac
done
# Who is not root is told what to install; root's make test installs it.
[ $# -gt 0 ] || set -- "make demo" "! setpriv --reuid=nobody --clear-groups make system" "make test"

cannot() {
  echo "bare machine: not here: $*" >&2
  exit $CANNOT
}

say() { echo "== bare machine, $(date +%T): $*"; }

# --- in the namespaces: make the root, mount, run the commands --------------------------------------------

# lend FOLDER [PLACE]: read-only at the same or the given place in the root.
lend() {
  local from to
  from=$(readlink -f "$1")
  to=$root${2:-$1}
  mkdir -p "$to"
  mount --bind "$from" "$to"
  mount -o remount,bind,ro "$to"
}

host_pip() { python3.11 -m pip "$@" 2>/dev/null || python3 -m pip "$@" 2>/dev/null || true; }

# The places on this machine that pip's configuration names, one a line.
pips_places() {
  local word
  for word in $(host_pip config list | sed 's/^[^=]*=//' | tr -d "'\""); do
    case $word in
      # The pages of an index may point to files beside it.
      file:///*/*) dirname "${word#file://}" ;;
      /*) echo "$word" ;;
    esac
  done | sort -u
}

lend_pips() {
  local place
  for place in /etc/pip.conf /etc/xdg/pip ~/.config/pip ~/.pip; do
    [ -e "$place" ] || continue
    mkdir -p "$root$(dirname "${place/#$HOME//root}")"
    cp -rL "$place" "$root${place/#$HOME//root}"
  done
  pips_places | while read -r place; do
    if [ -d "$place" ]; then
      [ -d "$root$place" ] || lend "$place"
    elif [ -f "$place" ]; then
      mkdir -p "$root$(dirname "$place")"
      cp -L "$place" "$root$place"
    fi
  done
}

# The variables that say how to reach a registry, and how processors and tests are to be treated.
lent_variables() {
  env -0 | while IFS= read -r -d '' pair; do
    case ${pair%%=*} in
      *_proxy | *_PROXY | PIP_* | SSL_CERT_* | *_CA_BUNDLE | OPENBLAS_* | PYTEST_ADDOPTS | CI) printf '%s\0' "$pair" ;;
    esac
  done
}

mount_all() {
  mount -t proc proc "$root/proc"
  mount --rbind /sys "$root/sys"
  mount -o remount,bind,ro "$root/sys"
  mount -t devpts -o newinstance,ptmxmode=0666 devpts "$root/dev/pts"
  mount -t tmpfs tmpfs "$root/dev/shm"
  lend_pips
  if [ -d "$here/../shared" ]; then lend "$here/../shared" "$(dirname $PLACE)/shared"; fi
}

choose_mirror() {
  local proxy=""
  if [ -z "$mirror" ] && command -v apt-get >/dev/null; then
    # shellcheck disable=SC2016  # the words are apt's
    mirror=$(apt-get indextargets --format '$(REPO_URI) $(RELEASE) $(COMPONENT)' |
      awk -v suite="$suite" '$2 == suite && $3 == "main" && !found {print $1; found = 1}') || mirror=""
  fi
  mirror=${mirror:-http://deb.debian.org/debian}
  if command -v apt-config >/dev/null; then
    eval "$(apt-config shell proxy Acquire::http::Proxy)"
    if [ -n "$proxy" ]; then export http_proxy=${http_proxy:-$proxy}; fi
  fi
}

# Each step by && : errexit does not hold in what is asked for its status.
make_root() {
  debootstrap --variant=minbase --include=ca-certificates "$suite" "$root" "$mirror" &&
    cp -L /etc/resolv.conf /etc/hosts "$root/etc/" &&
    ln -sf ../proc/self/mounts "$root/etc/mtab" && # as a machine that was booted has it; Blender warns without
    lend_apts &&
    chroot "$root" apt-get update -qq &&
    # Not by debootstrap, which knows no package that another provides, as python3.11-venv needs.
    DEBIAN_FRONTEND=noninteractive LC_ALL=C chroot "$root" \
      apt-get install -y -qq --no-install-recommends python3.11 python3.11-venv make git &&
    if [ -f $BUNDLE ]; then cp -L $BUNDLE "$root$BUNDLE"; fi
}

lend_apts() {
  command -v apt-config >/dev/null || return 0
  apt-config dump | grep -E '^Acquire::https?::(Proxy|CaInfo|Verify)' >"$root/etc/apt/apt.conf.d/00lent" || true
}

# Whoever runs it may not own the checkout, which git refuses unless told.
git_here() { git -c safe.directory='*' -C "$here" "$@"; }

clone() {
  mkdir -p "$root$PLACE" &&
    GIT_CONFIG_COUNT=1 GIT_CONFIG_KEY_0=safe.directory GIT_CONFIG_VALUE_0='*' \
      git clone --quiet --no-hardlinks "$here" "$root$PLACE"
}

inside() {
  local variables command started_s status log=$root.log
  choose_mirror
  say "a bare $suite from $mirror in $root"
  if ! make_root >"$log" 2>&1; then
    tail -n 20 "$log" >&2
    cannot "the root could not be made: see above"
  fi
  clone
  say "made in $SECONDS s: $(chroot "$root" dpkg-query -f '.' -W | wc -c) packages, $(du -sm "$root" | cut -f1) MB"
  say "the checkout is at $(git_here rev-parse --short HEAD)"
  [ -z "$(git_here status --porcelain)" ] || say "what is not committed is not tried"
  mount_all
  mapfile -d '' variables < <(lent_variables)
  for command in "$@"; do
    say "\$ $command"
    started_s=$SECONDS status=0
    env -i HOME=/root LANG=C.UTF-8 PATH=/usr/local/sbin:/usr/local/bin:/usr/sbin:/usr/bin:/sbin:/bin \
      "${variables[@]}" chroot "$root" bash -c "cd $PLACE && $command" || status=$?
    say "\$ $command: status $status after $((SECONDS - started_s)) s"
    [ $status = 0 ] || exit $status
  done
  say "done in $SECONDS s"
}

if [ -n "$inside" ]; then
  inside "$@"
  exit
fi

# --- before: can this machine, and a root ----------------------------------------------------------------

[ "$(uname -s)" = Linux ] || cannot "debootstrap wants Linux"
[ "$(id -u)" = 0 ] || cannot "mounts and chroot want root: sudo $0"
for program in debootstrap unshare chroot mount git; do
  command -v $program >/dev/null || cannot "$program is missing (Debian: apt-get install debootstrap util-linux git)"
done
NAMESPACES=(unshare --mount-proc --propagation private --pid --fork --kill-child)
"${NAMESPACES[@]}" chroot / true || cannot "no mounts or no chroot allowed"
[ -z "$check" ] || exit 0

if [ -z "$root" ]; then
  root=$(mktemp -d "${TMPDIR:-/tmp}/r2sego-bare.XXXXXX")
  chmod 755 "$root" # it is the root of other users too
else
  mkdir -p "$root"
  [ -z "$(ls -A "$root")" ] || { echo "bare machine: $root is not empty" >&2; exit 2; }
  root=$(cd "$root" && pwd)
fi
running=""
remove() {
  # unshare heeds no gentler signal; all in its namespace go with it.
  [ -z "$running" ] || { kill -KILL "$running" 2>/dev/null; wait "$running"; } || true
  if [ -n "$keep" ]; then
    echo "bare machine: kept in $root" >&2
  else
    rm -rf --one-file-system "$root"
    rm -f "$root.log"
  fi
}
trap remove EXIT
trap 'exit 130' INT
trap 'exit 143' TERM HUP

free_mb=$(df -Pm "$root" | awk 'NR == 2 {print $4}')
[ "$free_mb" -ge $NEEDED_MB ] || cannot "$root has $free_mb MB, and $NEEDED_MB are needed"

# In the background and waited for: a signal is then answered at once, by ending what runs.
waited() {
  local status=0
  "$@" &
  running=$!
  wait "$running" || status=$?
  running=""
  return $status
}

waited "${NAMESPACES[@]}" bash "$0" --inside --root "$root" --suite "$suite" --mirror "$mirror" "$@"
