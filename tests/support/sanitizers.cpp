// Options of the sanitizers for every test program, if it is built with them (see drivers.supp). The runtime looks
// these functions up by name, so they must be visible. NOLINTBEGIN(bugprone-reserved-identifier)
#define VISIBLE __attribute__((visibility("default")))

extern "C" {

// Threads' dynamic storage is not tracked: if glibc places a block of it 16 bytes behind the beginning of a page, GCC
// 12's runtime takes the bytes before it for the header of an old glibc. The leak search at exit then follows an
// invalid pointer and dies ("Tracer caught signal 11").
VISIBLE const char* __asan_default_options() { return "intercept_tls_get_addr=0"; }

VISIBLE const char* __lsan_default_options() { return "print_suppressions=0:suppressions=" VSPLAT_SUPPRESSIONS; }

// NOLINTEND(bugprone-reserved-identifier)
}  // extern "C"
