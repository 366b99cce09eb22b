#!/bin/sh
# Runs the README's two commands in a bare system made by debootstrap, as a new user would, who has a clone and may use sudo.
#   tests/systems/run.sh SYSTEM [--quickstart-only | --tests-only | --build-only] [--work DIR]
#     SYSTEM             bookworm, trixie, forky (Debian) or noble (Ubuntu)
#     --quickstart-only  only examples/quickstart.sh
#     --tests-only       only tests/run.sh
#     --build-only       only installs the packages and compiles everything, by the quick build
#     --work DIR         for the system, its downloads and the logs (default: $TMPDIR/vsplat-systems); takes some 15 GiB
# It clones what is committed. The logs are in DIR/SYSTEM-logs. The bare system and the downloads are kept for the next run; the system in
# which the commands ran is kept only after a failure. Exits with 77 without root, debootstrap, permission to mount, or the network.
# $VSPLAT_DEBIAN_MIRROR and $VSPLAT_UBUNTU_MIRROR replace the mirrors.
set -eu
here=$(cd "$(dirname "$0")" && pwd)
sources=$(cd "$here/../.." && pwd)
usage() {
  sed -n '2,/^set /{/^set /d; s/^# \{0,1\}//; p}' "$0" >&2
  exit 2
}
test=systems
. "$here/bare.sh"

parse() {
  system=${1-}
  [ $# -eq 0 ] || shift
  while [ $# -gt 0 ]; do
    case $1 in
      --quickstart-only) steps=quickstart ;;
      --tests-only) steps=tests ;;
      --build-only) steps=build ;;
      --work) [ $# -gt 1 ] || usage; work=$2; shift ;;
      *) usage ;;
    esac
    shift
  done
}
steps="quickstart tests"
work=${TMPDIR:-/tmp}/vsplat-systems
parse "$@"
components=main
keys=/usr/share/keyrings/debian-archive-keyring.gpg
keys_package=debian-archive-keyring
case $system in
  bookworm | trixie | forky) mirror=$debian ;;
  noble)
    mirror=${VSPLAT_UBUNTU_MIRROR:-http://archive.ubuntu.com/ubuntu} components=main,universe
    keys=/usr/share/keyrings/ubuntu-archive-keyring.gpg keys_package=ubuntu-keyring
    ;;
  *) usage ;;
esac

needs
[ -s "$keys" ] || skip "there is no $keys, which verifies the packages of $system (Debian: $keys_package)"
reaches "$mirror" "$system"
folder=$work
alone "$0" "$@"
work=$folder

mkdir -p "$work/$system-logs" "$work/$system-downloads/partial"
work=$(cd "$work" && pwd)
base=$work/$system-base root=$work/$system logs=$work/$system-logs
exec 9>"$work/$system.lock"
flock -n 9 || fail "another run uses $root"

if [ ! -d "$base" ]; then
  rm -rf --one-file-system "$base.new"
  make_system "$system" "$base.new" "$mirror" --components=$components --keyring="$keys" --include=ca-certificates,git,sudo
  # A mirror of an older date (a snapshot) will do.
  echo 'Acquire::Check-Valid-Until "false";' >"$base.new/etc/apt/apt.conf.d/90snapshot"
  mv "$base.new" "$base"
fi
rm -rf --one-file-system "$root"
cp -a "$base" "$root"
mount_system "$root"
mount --bind "$work/$system-downloads" "$root/var/cache/apt/archives"
echo "127.0.0.1 localhost $(hostname)" >"$root/etc/hosts"
within "$root" useradd --create-home --shell /bin/bash user
echo 'user ALL=(ALL) NOPASSWD: ALL' >"$root/etc/sudoers.d/user"
git -c safe.directory='*' clone -q --no-hardlinks "file://$sources" "$root/home/user/vsplat"
within "$root" chown -R user:user /home/user/vsplat
commit=$(git -c safe.directory='*' -C "$sources" rev-parse --short HEAD)
(. "$root/etc/os-release" && echo "$PRETTY_NAME, commit $commit, $(nproc) processors")

# step NAME COMMAND: runs it as the user, in the clone; prints its time.
code=0
step() {
  began=$(date +%s)
  result="succeeded"
  within "$root" runuser -u user -- env HOME=/home/user USER=user sh -c "cd /home/user/vsplat && $2" >"$logs/$1.log" 2>&1 </dev/null ||
    { result="failed with $?" code=1; }
  echo "$1: $result after $(($(date +%s) - began)) s, $logs/$1.log"
  sed -n 's/^this release has no /  no /p' "$logs/$1.log" | sort -u
  grep 'warning: .*\[-W' "$logs/$1.log" | sort -u | sed 's/^/  /' || true
  case $result in failed*) tail -n 30 "$logs/$1.log" | sed 's/^/    /' ;; esac
}
for name in $steps; do
  case $name in
    quickstart) step quickstart examples/quickstart.sh ;;
    build) step build "cmake/install-packages.sh --tests && cmake --preset release -DVSPLAT_TESTS=ON -DVSPLAT_QUICK_BUILD=ON &&
      cmake --build --preset release" ;;
    tests)
      step tests tests/run.sh
      build=$root/home/user/vsplat/build/release
      if [ -s "$build/tests.xml" ]; then "$here/summary.py" "$build"; fi
      ;;
  esac
done
if [ $code = 0 ]; then
  remove_system "$root"
else
  echo "The system is kept in $root. Remove it with rm -rf, or go on in it by: chroot $root su - user" >&2
fi
exit $code
