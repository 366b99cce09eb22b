#include <stdio.h>
#include <vsplat/vsplat.h>

int main(void) {
  size_t count = 0;
  if (vsplat_version() != VSPLAT_VERSION || vsplat_device_count(&count) != VSPLAT_OK) return 1;
  printf("vsplat %s, %u devices\n", vsplat_version_string(), (unsigned)count);
  return 0;
}
