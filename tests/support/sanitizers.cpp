// What every test program tells the sanitizers, where it is built with them (see drivers.supp).
// The runtime looks these up by name: they must be visible. NOLINTBEGIN(bugprone-reserved-identifier)
#define VISIBLE __attribute__((visibility("default")))

extern "C" {

// Leaks are told apart by whose they are; that takes whole call stacks.
VISIBLE const char* __asan_default_options() { return "fast_unwind_on_malloc=0"; }

VISIBLE const char* __lsan_default_options() { return "print_suppressions=0:suppressions=" VSPLAT_SUPPRESSIONS; }

// NOLINTEND(bugprone-reserved-identifier)
}  // extern "C"
