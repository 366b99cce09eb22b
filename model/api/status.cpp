// Statuses, the last error, version, text, the log, and files.
#include <algorithm>
#include <cstdlib>

#include "model/api/handle.h"
#include "runtime/file.h"
#include "runtime/file_rules.h"
#include "runtime/host_memory.h"
#include "runtime/log.h"

namespace vsplat::api {
namespace {

// Fixed memory, so that reporting an error cannot fail.
struct LastError {
  char text[4096] = "";
};
thread_local LastError last_error;

}  // namespace

void set_last_error(const char* text) noexcept {
  std::strncpy(last_error.text, text, sizeof last_error.text - 1);
  last_error.text[sizeof last_error.text - 1] = '\0';
}

std::string name_in_profiles(const char* function) {
  std::string out(function);
  if (out.rfind("vsplat_", 0) == 0) out.erase(0, 7);
  std::replace(out.begin(), out.end(), '_', ' ');
  return out;
}

char* new_text(const std::string& text) {
  auto* out = static_cast<char*>(std::malloc(text.size() + 1));
  if (!out) throw std::bad_alloc();
  std::memcpy(out, text.c_str(), text.size() + 1);
  return out;
}

}  // namespace vsplat::api

using namespace vsplat;

static_assert(VSPLAT_ERROR_USAGE == static_cast<int>(Status::usage) &&
              VSPLAT_ERROR_FILE == static_cast<int>(Status::file) &&
              VSPLAT_ERROR_FORMAT == static_cast<int>(Status::format) &&
              VSPLAT_ERROR_INPUT == static_cast<int>(Status::input) &&
              VSPLAT_ERROR_DEVICE == static_cast<int>(Status::device) &&
              VSPLAT_ERROR_COMPILE == static_cast<int>(Status::compile) &&
              VSPLAT_ERROR_MEMORY == static_cast<int>(Status::memory) &&
              VSPLAT_ERROR_CANCELLED == static_cast<int>(Status::cancelled) &&
              VSPLAT_ERROR_INTERNAL == static_cast<int>(Status::internal) &&
              VSPLAT_ERROR_BUSY == static_cast<int>(Status::busy));

const char* vsplat_status_name(vsplat_status status) {
  switch (api::value_of(status)) {
    case VSPLAT_OK:
      return "ok";
    case VSPLAT_ERROR_USAGE:
      return "usage";
    case VSPLAT_ERROR_FILE:
      return "file";
    case VSPLAT_ERROR_FORMAT:
      return "format";
    case VSPLAT_ERROR_INPUT:
      return "input";
    case VSPLAT_ERROR_DEVICE:
      return "device";
    case VSPLAT_ERROR_COMPILE:
      return "compile";
    case VSPLAT_ERROR_MEMORY:
      return "memory";
    case VSPLAT_ERROR_CANCELLED:
      return "cancelled";
    case VSPLAT_ERROR_INTERNAL:
      return "internal";
    case VSPLAT_ERROR_BUSY:
      return "busy";
  }
  return "unknown";
}

const char* vsplat_last_error(void) { return api::last_error.text; }

uint32_t vsplat_version(void) { return VSPLAT_VERSION; }
const char* vsplat_version_string(void) { return VSPLAT_VERSION_STRING; }

void vsplat_text_free(char* text) { std::free(text); }

void vsplat_log_set(vsplat_log_function function, void* user) {
  if (!function) {
    set_log_sink({});
    return;
  }
  set_log_sink([function, user](LogLevel level, const std::string& text) {
    function(user, static_cast<vsplat_log_level>(level), text.c_str());
  });
}

vsplat_status vsplat_set_host_memory(uint64_t bytes) {
  return api::guarded([&] { set_host_memory_limit(bytes); });
}

vsplat_status vsplat_get_host_memory(uint64_t* out_limit, uint64_t* out_reserved) {
  return api::guarded([&] {
    if (out_limit) *out_limit = host_memory_limit();
    if (out_reserved) *out_reserved = reserved_host_memory();
  });
}

vsplat_status vsplat_file_rules_set(const vsplat_file_rules* rules) {
  return api::guarded([&] {
    const vsplat_file_rules r = api::taken(rules, VSPLAT_FILE_RULES_INIT, "rules");
    FileRules out;
    out.allow_outside = r.allow_outside != 0;
    if (r.may_replace)
      out.may_replace = [r](const std::string& path) { return r.may_replace(r.user, path.c_str()) != 0; };
    if (r.on_written)
      out.written = [r](const std::string& path, bool created) { r.on_written(r.user, path.c_str(), created ? 1 : 0); };
    set_file_rules(std::move(out));
  });
}

vsplat_status vsplat_file_write(const char* path, const void* data, size_t bytes) {
  return api::guarded([&] {
    api::need(path, "path");
    api::need_array(data, bytes, "data");
    write_file(path, data, bytes);
  });
}
