// What is asked of the operating system that C++'s library does not know: with system_channel.h and system_process.h
// the one way to it, for the library, the command and the bench. It knows nothing of this library, throws no Error and
// has no words for people: std::error_code's are the system's own. What is not said to do otherwise follows links.
#pragma once
#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <filesystem>
#include <limits>
#include <optional>
#include <string>
#include <system_error>

#include "runtime/handle.h"

namespace vsplat::sys {

// ----------------------------------------------------------------------------------------------------------------
// files and folders

struct FileFacts {
  enum class Kind { file, folder, other };  // other: pipes, devices, a link that was not followed

  Kind kind = Kind::other;
  std::uint64_t device = 0, node = 0;        // which of all that are there now: two names of one file have the same
  std::uint64_t size = 0;                    // bytes
  std::int64_t changed = 0, changed_ns = 0;  // what is in it: seconds since 1970, and nanoseconds beyond them
  bool ours_alone = false;                   // this user's, or the system's, and nobody else may write to it

  bool is_file() const { return kind == Kind::file; }
  bool is_folder() const { return kind == Kind::folder; }
  bool same_as(const FileFacts& other) const { return device == other.device && node == other.node; }
};

// Nothing where it is not there, or cannot be looked at.
std::optional<FileFacts> facts_of(const std::filesystem::path& path);
std::optional<FileFacts> facts_of_entry(const std::filesystem::path& path);  // of a link: its own
std::optional<FileFacts> facts_of(const Handle& opened, std::error_code& error);
std::optional<FileFacts> facts_of(std::FILE* opened);

enum class Links { followed, refused };
// Who may have what is made: whomever the process lets (its umask), or its owner alone.
enum class Whose { everybody, owner };

// None of what is opened here is passed on to programs that are started. `error` is cleared where all went well.
// To be read; does not wait for whoever writes into a pipe.
Handle open_to_read(const std::filesystem::path& path, std::error_code& error, Links links = Links::followed);
Handle open_folder(const std::filesystem::path& path, std::error_code& error);
// To be written; file_exists where anything has that name, a link to nothing, too.
Handle create_new(const std::filesystem::path& path, Whose whose, std::error_code& error);
// As C has it, "rb" or "wb". Null where that fails; the handle is closed then.
std::FILE* stream(Handle opened, const char* mode, std::error_code& error);
int number_of(std::FILE* opened);

// -> how many of the bytes from `offset` on, fewer where the file ends there, or on an error.
std::size_t read_at(const Handle& file, std::uint64_t offset, void* to, std::size_t bytes, std::error_code& error);
std::error_code seek(std::FILE* file, std::uint64_t offset);
// To the disk; of a C stream what was flushed.
std::error_code sync(std::FILE* file);

// Each in one step, whatever others do meanwhile.
std::error_code make_folder(const std::filesystem::path& path, Whose whose);
// A second name for a file, or for a link itself.
std::error_code link(const std::filesystem::path& from, const std::filesystem::path& to);
// file_exists or directory_not_empty where something is at `to`; invalid_argument or function_not_supported where the
// file system cannot do it, or exchange() two names.
std::error_code rename_to_new(const std::filesystem::path& from, const std::filesystem::path& to);
std::error_code exchange(const std::filesystem::path& one, const std::filesystem::path& other);
// No folder; and nothing but an empty folder.
void remove_file(const std::filesystem::path& path);
void remove_folder(const std::filesystem::path& path);
// False where another process, or another handle of this one, has the folder's lock; true where the file system knows
// none. Held until the handle is closed, or the process has ended.
bool lock(const Handle& folder);

// Whether a file can be made in the folder, by making one that is gone at once.
std::error_code try_new_file_in(const std::filesystem::path& folder);
// Whether a device's file can be opened to be read and written, and the group that it belongs to.
std::error_code try_device(const std::filesystem::path& file);
std::string group_of(const std::filesystem::path& file);

// ----------------------------------------------------------------------------------------------------------------
// this process and where it runs

int process_id();
bool error_output_is_terminal();
std::filesystem::path program_path(std::error_code& error);
// Where it is not set yet.
void set_variable(const char* name, const char* value);

// `handler` is called, in a thread of its own, with the number of the first signal that asks this program to end; the
// second one ends it. A hang-up that whoever started it had ignored (nohup) stays ignored. What tells of a write that
// fails is left to the write. To be called before there is another thread, and again in a process that split_process()
// made.
void catch_stops(void (*handler)(int));
// From now on the first one ends the program.
void let_stops_end();

// The program's last words where a fault ends it, a driver's or its own: written to the error output, before it ends as
// it would have. Where something else already answers faults (a sanitizer) nothing changes.
void tell_of_faults(const std::string& text);

// The system's words for it; "" where it does not know.
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
// What this process could still have: of the host's, of what it was granted, of its address space.
std::size_t free_memory();

// ----------------------------------------------------------------------------------------------------------------
// libraries

enum class Symbols { own, shared };  // with all that is loaded later
// Stays loaded. Null where it cannot be loaded: `why`, in the loader's words, which may be none.
void* load_library(const std::string& path, Symbols symbols, std::string& why);
// Null where it has none of that name.
void* symbol(void* library, const char* name);
// The file of the library, or of the program, in which `address` is code or data; "" where that is not known.
std::string library_of(const void* address);

}  // namespace vsplat::sys
