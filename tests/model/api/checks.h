/* Checks for the tests in plain C: a call's exact status, with a message if it failed, and conditions. The message
   addresses a programmer: it names no command-line option. */
#ifndef VSPLAT_TESTS_API_CHECKS_H
#define VSPLAT_TESTS_API_CHECKS_H
#include <stdio.h>
#include <string.h>
#include <vsplat/vsplat.h>

static int failures = 0;

static void expect_at(int line, vsplat_status got, vsplat_status wanted, const char* call) {
  if (got == wanted && (got == VSPLAT_OK || (strlen(vsplat_last_error()) > 0 && !strstr(vsplat_last_error(), "--"))))
    return;
  ++failures;
  printf("line %d: %s: %s, %s expected (%s)\n", line, call, vsplat_status_name(got), vsplat_status_name(wanted),
         vsplat_last_error());
}
#define EXPECT(status, call) expect_at(__LINE__, call, status, #call)

static void hold_at(int line, int good, const char* what) {
  if (good) return;
  ++failures;
  printf("line %d: %s does not hold\n", line, what);
}
#define HOLD(what) hold_at(__LINE__, (what) != 0, #what)

#endif
