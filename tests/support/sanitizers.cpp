// What every test program tells the sanitizers, where it is built with them (see drivers.supp).
// The runtime looks these up by name: they must be visible. NOLINTBEGIN(bugprone-reserved-identifier)
#define VISIBLE __attribute__((visibility("default")))

extern "C" {

// A thread's dynamic storage is not followed:
// where glibc put a block of it 16 bytes behind a page's begin, GCC 12's runtime takes what stands before it for an old
// glibc's header, and the search for leaks at the end reads where that points and dies ("Tracer caught signal 11").
VISIBLE const char* __asan_default_options() { return "intercept_tls_get_addr=0"; }

VISIBLE const char* __lsan_default_options() { return "print_suppressions=0:suppressions=" VSPLAT_SUPPRESSIONS; }

// NOLINTEND(bugprone-reserved-identifier)
}  // extern "C"
