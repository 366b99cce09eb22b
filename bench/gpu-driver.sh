# shellcheck shell=sh disable=SC2154 # of whoever sources it: top, work
# What scripts share that run on a machine which has a GPU's driver and nothing else; sourced by them. They give $top, the tree's or the
# bundle's first folder; $work, where they work; say() and fail().

# find_vsplat: $vsplat is the program, of $VSPLAT, of the bundle or of the build.
find_vsplat() {
  vsplat=${VSPLAT-}
  for file in "$top/bin/vsplat" "$top/build/release/bin/vsplat"; do
    if [ -z "$vsplat" ] && [ -x "$file" ]; then vsplat=$file; fi
  done
  [ -n "$vsplat" ] || fail "no vsplat in $top/bin or $top/build/release/bin: build it, or unpack what cmake/bundle.sh packs"
  version=$("$vsplat" --version 2>&1) ||
    fail "$vsplat does not run on this machine ($version); cmake/bundle.sh packs it with the libraries that it needs"
}

# An OpenCL loader finds a driver by a file in a folder, which containers often lack though the driver is there.
vendors=/etc/OpenCL/vendors
driver='' looked=''
folders="/usr/lib/x86_64-linux-gnu /usr/lib/aarch64-linux-gnu /usr/lib64 /usr/lib /usr/local/nvidia/lib64 /usr/local/nvidia/lib
  /usr/local/cuda/compat /usr/local/cuda/lib64 /usr/lib/wsl/lib /run/opengl-driver/lib /usr/lib/nvidia"
find_driver() {
  # ldconfig's list, where this is one; /sbin is not on everybody's path.
  driver=$(PATH=$PATH:/usr/sbin:/sbin ldconfig -p 2>/dev/null | awk '$1 == "libnvidia-opencl.so.1" { print $NF; exit }') || driver=
  looked="what ldconfig -p lists"
  if [ -n "$driver" ] && [ -e "$driver" ]; then return; fi
  driver=
  for folder in $(printf '%s' "${LD_LIBRARY_PATH-}" | tr ':' ' ') $folders; do
    looked="$looked, $folder"
    for file in "$folder/libnvidia-opencl.so.1" "$folder"/libnvidia-opencl.so.*; do
      if [ -z "$driver" ] && [ -e "$file" ]; then driver=$file; fi
    done
    if [ -n "$driver" ]; then
      # What the driver loads in turn lies beside it, where the system does not look.
      LD_LIBRARY_PATH=${LD_LIBRARY_PATH:+$LD_LIBRARY_PATH:}$folder
      export LD_LIBRARY_PATH
      return
    fi
  done
}

# name_driver: NVIDIA's driver has an entry, made in $work/vendors where the system has none; $looked says where it was looked for.
name_driver() {
  if [ -n "${OCL_ICD_VENDORS-}" ]; then
    looked="OCL_ICD_VENDORS=$OCL_ICD_VENDORS, which is set here and says where the loader looks"
    say "the driver is what OCL_ICD_VENDORS=$OCL_ICD_VENDORS says"
    return
  fi
  # Khronos's loader reads it, and the one that comes with vsplat (ocl-icd) does not: images for CUDA have it set.
  if [ -n "${OCL_ICD_FILENAMES-}" ]; then say "OCL_ICD_FILENAMES=$OCL_ICD_FILENAMES is not used"; fi
  find_driver
  if [ -z "$driver" ]; then
    say "no libnvidia-opencl.so.1; drivers that $vendors names are used"
  elif grep -qs nvidia "$vendors"/*.icd; then
    say "driver $driver, which $vendors names"
  else
    mkdir -p "$work/vendors"
    cp "$vendors"/*.icd "$work/vendors/" 2>/dev/null || :
    printf '%s\n' "$driver" >"$work/vendors/nvidia.icd"
    export OCL_ICD_VENDORS="$work/vendors"
    say "driver $driver; $vendors does not name it: an entry of its own does, in $OCL_ICD_VENDORS"
  fi
  looked="$vendors; for NVIDIA's driver (libnvidia-opencl.so.1) at $looked"
}

# say_no_device: what there is instead of one.
say_no_device() {
  nodes=''
  for node in /dev/nvidia[0-9]* /dev/dxg; do
    if [ -e "$node" ]; then nodes="$nodes $node"; fi
  done
  say "looked at: $looked"
  if [ -n "$nodes" ]; then
    say "the machine has a device (${nodes# }): its container may lack the driver's OpenCL part (NVIDIA_DRIVER_CAPABILITIES=compute,utility)"
  else
    say "there is no /dev/nvidia0: the machine has no NVIDIA GPU, or its container was not given it"
  fi
}

# field NAME: the first value of a JSON field from stdin, one field a line as vsplat prints it
field() { sed -n "s/^.*\"$1\": *\"\{0,1\}\([^\",]*\).*$/\1/p" | head -n 1; }
