// Operating system functions that C++'s library lacks. Together with system_channel.h and system_process.h this is the
// only access to the system, for the library, the command and the bench. It knows nothing of this library, throws no
// Error and has no messages of its own: texts of std::error_code are the system's. Functions follow links unless they
// say otherwise.
#pragma once
#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <filesystem>
#include <limits>
#include <optional>
#include <string>
#include <system_error>

#include "runtime/system/os_handle.h"

namespace vsplat::sys {

// ----------------------------------------------------------------------------------------------------------------
// files and folders

struct FileFacts {
  enum class Kind { file, folder, other };  // other: pipes, devices, a link that was not followed

  Kind kind = Kind::other;
  std::uint64_t device = 0, node = 0;        // identity among existing files: two names of one file have the same
                                             // values
  std::uint64_t size = 0;                    // bytes
  std::int64_t changed = 0, changed_ns = 0;  // last change of the content: seconds since 1970, and additional
                                             // nanoseconds
  bool ours_alone = false;                   // owned by this user or the system, and writable by no one else

  bool is_file() const { return kind == Kind::file; }
  bool is_folder() const { return kind == Kind::folder; }
  bool same_as(const FileFacts& other) const { return device == other.device && node == other.node; }
};

// Empty if the file does not exist or cannot be examined.
std::optional<FileFacts> facts_of(const std::filesystem::path& path);
std::optional<FileFacts> facts_of_entry(const std::filesystem::path& path);  // of a link itself, not its target
std::optional<FileFacts> facts_of(const Handle& opened, std::error_code& error);
std::optional<FileFacts> facts_of(std::FILE* opened);

enum class Links { followed, refused };
// Access to a new file: everybody whom the process's umask permits, or only the owner.
enum class Whose { everybody, owner };

// The following functions open files. Started programs inherit none of the handles. `error` is cleared on success.
// open_to_read() opens for reading and does not wait for a pipe's writer.
Handle open_to_read(const std::filesystem::path& path, std::error_code& error, Links links = Links::followed);
Handle open_folder(const std::filesystem::path& path, std::error_code& error);
// Creates a new file for writing; file_exists if the name exists, even as a dangling link.
Handle create_new(const std::filesystem::path& path, Whose whose, std::error_code& error);
// Makes a C stream; `mode` as in C, "rb" or "wb". On failure returns null and closes the handle.
std::FILE* stream(Handle opened, const char* mode, std::error_code& error);
int number_of(std::FILE* opened);

// Returns the number of bytes read from `offset` on: fewer than asked for at the end of the file, or on an error.
std::size_t read_at(const Handle& file, std::uint64_t offset, void* to, std::size_t bytes, std::error_code& error);
std::error_code seek(std::FILE* file, std::uint64_t offset);
// Flushes to disk; for a C stream, the data that was already flushed from its buffer.
std::error_code sync(std::FILE* file);

// The following calls are atomic.
std::error_code make_folder(const std::filesystem::path& path, Whose whose);
// Creates a hard link to a file, or to a link itself.
std::error_code link(const std::filesystem::path& from, const std::filesystem::path& to);
// file_exists or directory_not_empty if `to` exists; invalid_argument or function_not_supported if the file system
// cannot do it, or cannot exchange() two names.
std::error_code rename_to_new(const std::filesystem::path& from, const std::filesystem::path& to);
std::error_code exchange(const std::filesystem::path& one, const std::filesystem::path& other);
// remove_file() removes no folder; remove_folder() removes only an empty folder.
void remove_file(const std::filesystem::path& path);
void remove_folder(const std::filesystem::path& path);
// Locks a folder. False if another process, or another handle of this one, holds the lock; true if the file system has
// no locks. The lock is held until the handle is closed or the process ends.
bool lock(const Handle& folder);

// Whether a file of so many bytes can be created in the folder, tested by creating one and removing it at once.
std::error_code try_new_file_in(const std::filesystem::path& folder, std::size_t bytes = 0);
// Whether a device file can be opened for reading and writing; and the group that it belongs to.
std::error_code try_device(const std::filesystem::path& file);
std::string group_of(const std::filesystem::path& file);

// ----------------------------------------------------------------------------------------------------------------
// this process and where it runs

int process_id();
bool error_output_is_terminal();
std::filesystem::path program_path(std::error_code& error);
// Sets an environment variable unless it is set already.
void set_variable(const char* name, const char* value);
// Unsets an environment variable that is set to an empty text.
void unset_if_empty(const char* name);

// Calls `handler`, on a thread of its own, with the number of the first signal that asks this program to end; the
// second signal ends it. A hang-up that the parent had set to be ignored (nohup) stays ignored. A broken pipe raises no
// signal: the failing write reports it. Call this before any other thread exists, and again in a process that
// split_process() created.
void catch_stops(void (*handler)(int));
// From now on the first such signal ends the program.
void let_stops_end();

// Prints `text` to the error output when a fault in a driver or in the program itself ends the program, which then ends
// as it would have. Does nothing if a fault handler is installed already (a sanitizer's).
void tell_of_faults(const std::string& text);

// The user's name and home folder, as the system reports them; "" if unknown.
struct User {
  std::string name, home;
};
User this_user();
std::string host_name();

struct Host {
  std::string kernel, machine, libc;
  long processors = 0;
  std::uint64_t memory = 0;  // bytes
};
Host this_host();

constexpr std::size_t kUnknownMemory = std::numeric_limits<std::size_t>::max();
// Memory that this process could still allocate: the minimum over the host's, its control groups' and its address
// space's.
std::size_t free_memory();

// ----------------------------------------------------------------------------------------------------------------
// libraries

enum class Symbols { own, shared };  // shared: symbols are visible to all libraries that are loaded later
// Loads a library, which stays loaded. On failure returns null and sets `why` to the loader's message, which may be
// empty.
void* load_library(const std::string& path, Symbols symbols, std::string& why);
// Null if the library has no symbol of that name.
void* symbol(void* library, const char* name);
// The file of the library or program whose code or data contains `address`; "" if unknown.
std::string library_of(const void* address);

}  // namespace vsplat::sys
