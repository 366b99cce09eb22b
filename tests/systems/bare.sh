# What tests in bare systems made by debootstrap share. Sourced with `set -eu` by scripts that have set `test`, their name in messages.
# $VSPLAT_DEBIAN_MIRROR replaces deb.debian.org.
debian=${VSPLAT_DEBIAN_MIRROR:-http://deb.debian.org/debian}
skip() {
  echo "skipped: $*" >&2
  exit 77
}
fail() {
  echo "$test: $*" >&2
  exit 1
}
# needs PROGRAM...: for a test that makes systems
needs() {
  [ "$(id -u)" = 0 ] || skip "only root may make a system"
  for program in debootstrap "$@"; do command -v "$program" >/dev/null || skip "there is no $program"; done
}
# reaches MIRROR SUITE
reaches() {
  file=$(mktemp) got=yes
  /usr/lib/apt/apt-helper download-file "$1/dists/$2/Release" "$file" >/dev/null 2>&1 || got=
  rm -f "$file"
  [ -n "$got" ] || skip "$1 cannot be reached"
}
# alone SCRIPT ARGUMENTS...: goes on in namespaces of its own, so that no mount and no process is left, whatever ends it. $work is a new
# folder there, which is removed with everything in it.
alone() {
  work=${VSPLAT_ALONE-}
  [ -z "$work" ] || return 0
  unshare --mount --pid --fork true 2>/dev/null || skip "nothing can be mounted here"
  work=$(mktemp -d)
  chmod 755 "$work"
  VSPLAT_ALONE=$work unshare --mount --pid --fork --kill-child --propagation private "$@" &
  trap 'kill -KILL $!; rm -rf --one-file-system "$work"; exit 143' HUP INT TERM  # unshare ignores what would end it gently
  code=0
  wait $! || code=$?
  rm -rf --one-file-system "$work"
  exit $code
}
# make_system SUITE ROOT MIRROR [OPTION]...: with debootstrap's options
make_system() {
  suite=$1 to=$2 from=$3
  shift 3
  script=
  [ -e "/usr/share/debootstrap/scripts/$suite" ] || case $suite in  # what an older debootstrap knows
    noble) script=gutsy ;;
    *) script=sid ;;
  esac
  debootstrap --variant=minbase "$@" "$suite" "$to" "$from" $script >"$to.log" 2>&1 || { tail -n 20 "$to.log" >&2; fail "debootstrap failed"; }
  rm "$to.log"
  printf '#!/bin/sh\nexit 101\n' >"$to/usr/sbin/policy-rc.d"  # no service may start
  chmod 755 "$to/usr/sbin/policy-rc.d"
}
# mount_system ROOT
mount_system() {
  mount -t proc proc "$1/proc" || skip "nothing can be mounted here"
  mount -t sysfs -o ro sysfs "$1/sys"
  mount --bind /dev "$1/dev"
  mount -t devpts -o newinstance,ptmxmode=0666 devpts "$1/dev/pts"
  mount -t tmpfs -o mode=1777 tmpfs "$1/dev/shm"
  cp /etc/resolv.conf "$1/etc/resolv.conf" 2>/dev/null || true
}
# remove_system ROOT: and what is mounted there
remove_system() {
  for folder in var/cache/apt/archives proc sys dev/shm dev/pts dev; do
    if mountpoint -q "$1/$folder"; then umount -l "$1/$folder" || return; fi
  done
  rm -rf --one-file-system "$1"
}
# within ROOT COMMAND...
within() {
  inside=$1
  shift
  env -i PATH=/usr/local/sbin:/usr/local/bin:/usr/sbin:/usr/bin:/sbin:/bin LANG=C.UTF-8 chroot "$inside" "$@"
}
