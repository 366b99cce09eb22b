// Statuses, the last error, version, strings, the log, and files.
#include <algorithm>
#include <cstdlib>

#include "model/api/handle.h"
#include "runtime/files/file.h"
#include "runtime/files/file_rules.h"
#include "runtime/files/output_file.h"
#include "runtime/log.h"
#include "runtime/system/host_memory.h"

namespace vsplat::api {
namespace {

// Fixed memory, so that reporting an error cannot fail.
struct LastError {
  char text[4096] = "";
};
thread_local LastError last_error;
thread_local Holding* innermost_call = nullptr;

}  // namespace

Holding*& Holding::innermost() noexcept { return innermost_call; }

void check_count(std::size_t count, std::size_t bytes, const char* what) {
  constexpr std::size_t most = PTRDIFF_MAX;
  if (count > most / bytes) fail(Status::usage, "the count of {} is {}: no memory holds so many", what, count);
}

void check_struct_size(std::size_t size, std::size_t known, std::span<const FieldBytes> longer, const char* what) {
  constexpr std::size_t word = sizeof(std::size_t);
  if (size < 2 * word) fail(Status::usage, "{}.size is {}: start from the struct's _INIT macro", what, size);
  bool cut = size % word != 0;
  for (const FieldBytes& field : longer) cut = cut || (size < known && field.begin < size && size < field.end);
  if (cut)
    fail(Status::usage, "{}.size is {}, which ends within a field: start from the struct's _INIT macro", what, size);
}

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

void give_bytes(const std::function<void(const std::string& name)>& write, const char* name, char** out_bytes,
                std::size_t* out_size) {
  need(out_bytes, "out_bytes");
  need(out_size, "out_size");
  const OutputToMemory memory;
  write(name);
  *out_bytes = new_text(memory.bytes());
  *out_size = memory.bytes().size();
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
