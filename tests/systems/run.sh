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
skip() {
  echo "skipped: $*" >&2
  exit 77
}
fail() {
  echo "systems: $*" >&2
  exit 1
}

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
case $system in  # like: what an older debootstrap knows
  bookworm | trixie | forky) mirror=${VSPLAT_DEBIAN_MIRROR:-http://deb.debian.org/debian} like=sid ;;
  noble)
    mirror=${VSPLAT_UBUNTU_MIRROR:-http://archive.ubuntu.com/ubuntu} like=gutsy components=main,universe
    keys=/usr/share/keyrings/ubuntu-archive-keyring.gpg keys_package=ubuntu-keyring
    ;;
  *) usage ;;
esac

[ "$(id -u)" = 0 ] || skip "only root may make a system"
command -v debootstrap >/dev/null || skip "there is no debootstrap (Debian: debootstrap)"
[ -s "$keys" ] || skip "there is no $keys, which verifies the packages of $system (Debian: $keys_package)"
wget -q -t 2 -T 20 -O /dev/null "$mirror/dists/$system/Release" || skip "$mirror cannot be reached"
# In namespaces of its own, so that no mount and no process is left, whatever ends this.
if [ "${VSPLAT_SYSTEM_ALONE-}" != yes ]; then
  unshare --mount --pid --fork true 2>/dev/null || skip "nothing can be mounted here"
  VSPLAT_SYSTEM_ALONE=yes unshare --mount --pid --fork --kill-child --propagation private "$0" "$@" &
  trap 'kill -KILL $!; exit 143' HUP INT TERM  # unshare ignores what would end it gently
  code=0
  wait $! || code=$?
  exit $code
fi

mkdir -p "$work/$system-logs" "$work/$system-downloads/partial"
work=$(cd "$work" && pwd)
base=$work/$system-base root=$work/$system logs=$work/$system-logs
exec 9>"$work/$system.lock"
flock -n 9 || fail "another run uses $root"
unmount() {
  for folder in proc sys dev/shm dev/pts dev var/cache/apt/archives; do
    if mountpoint -q "$root/$folder"; then umount -l "$root/$folder"; fi
  done
}

if [ ! -d "$base" ]; then
  rm -rf --one-file-system "$base.new"
  script=
  [ -e "/usr/share/debootstrap/scripts/$system" ] || script=$like
  debootstrap --variant=minbase --components=$components --keyring="$keys" --include=ca-certificates,git,sudo "$system" "$base.new" "$mirror" \
    $script >"$logs/debootstrap.log" 2>&1 || { tail -n 20 "$logs/debootstrap.log" >&2; fail "debootstrap failed: $logs/debootstrap.log"; }
  printf '#!/bin/sh\nexit 101\n' >"$base.new/usr/sbin/policy-rc.d"  # no service may start
  chmod 755 "$base.new/usr/sbin/policy-rc.d"
  # A mirror of an older date (a snapshot) will do.
  echo 'Acquire::Check-Valid-Until "false";' >"$base.new/etc/apt/apt.conf.d/90snapshot"
  mv "$base.new" "$base"
fi
rm -rf --one-file-system "$root"
cp -a "$base" "$root"
mount -t proc proc "$root/proc" || skip "nothing can be mounted here"
mount -t sysfs -o ro sysfs "$root/sys"
mount --bind /dev "$root/dev"
mount -t devpts -o newinstance,ptmxmode=0666 devpts "$root/dev/pts"
mount -t tmpfs -o mode=1777 tmpfs "$root/dev/shm"
mount --bind "$work/$system-downloads" "$root/var/cache/apt/archives"
cp /etc/resolv.conf "$root/etc/resolv.conf" 2>/dev/null || true
echo "127.0.0.1 localhost $(hostname)" >"$root/etc/hosts"
within() { env -i PATH=/usr/local/sbin:/usr/local/bin:/usr/sbin:/usr/bin:/sbin:/bin LANG=C.UTF-8 chroot "$root" "$@"; }
within useradd --create-home --shell /bin/bash user
echo 'user ALL=(ALL) NOPASSWD: ALL' >"$root/etc/sudoers.d/user"
git -c safe.directory='*' clone -q --no-hardlinks "file://$sources" "$root/home/user/vsplat"
within chown -R user:user /home/user/vsplat
commit=$(git -c safe.directory='*' -C "$sources" rev-parse --short HEAD)
(. "$root/etc/os-release" && echo "$PRETTY_NAME, commit $commit, $(nproc) processors")

# step NAME COMMAND: runs it as the user, in the clone; prints its time.
code=0
step() {
  began=$(date +%s)
  result="succeeded"
  within runuser -u user -- env HOME=/home/user USER=user sh -c "cd /home/user/vsplat && $2" >"$logs/$1.log" 2>&1 </dev/null ||
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
unmount
if [ $code = 0 ]; then
  rm -rf --one-file-system "$root"
else
  echo "The system is kept in $root. Remove it with rm -rf, or go on in it by: chroot $root su - user" >&2
fi
exit $code
