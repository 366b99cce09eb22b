// The files that a command will write: checked before anything is computed, and removed if it ends early.
#pragma once
#include <cstdint>
#include <filesystem>
#include <map>
#include <mutex>
#include <string>
#include <vector>

#include "runtime/system/system.h"

namespace command {

// Whether files may name others that lie anywhere; for the whole process.
void allow_outside(bool allowed);

class Outputs {
 public:
  // Only one may exist at a time: the library asks it what may be replaced, and reports to it what was created.
  explicit Outputs(bool overwrite);
  // Unless commit() was called, removes what was begun and created by this process: files first, then the folders made
  // for them.
  ~Outputs();
  Outputs(const Outputs&) = delete;
  Outputs& operator=(const Outputs&) = delete;

  // Registers a file that will be written. UsageError if it is named twice, is an input, or is the folder of another
  // output; std::runtime_error if it exists (unless overwriting), is not a regular file, or its folder cannot be
  // written. "" is no file.
  void expect(const std::string& path);
  // The same for a file that an earlier run may have left for this one to continue: it is replaced if it exists.
  void expect_renewed(const std::string& path);
  // Registers a file that is read: it is never overwritten, not even with --overwrite. UsageError if it is an expected
  // output.
  void input(const std::string& path);

  // The same for a list of cameras, and for the files that list them in a folder.
  void input_cameras(const std::string& path);
  // The same for all files that data sets list; call it after expect().
  void input_data(const std::vector<std::string>& paths);

  // Registers a file of an earlier run that commit() removes; does nothing unless overwriting. UsageError if it is an
  // input.
  void expect_gone(const std::string& path);

  // Makes the folder of `path`, before it is written. Returns the path.
  std::string begin(const std::string& path);
  // Keeps what was begun so far, however the command ends.
  void keep();
  // Removes what was begun since then and created by this process, as the end of a command that fails does.
  void drop();
  // Keeps everything, once all is written, and removes what expect_gone() named. Like keep(), throws std::runtime_error
  // if another program has removed what was written.
  void commit();

 private:
  // A file that this process created. A file found there later may be another program's.
  struct Made {
    std::filesystem::path path;
    vsplat::sys::FileFacts facts;
    bool still_there() const;
  };
  static std::int32_t on_exists(void* outputs, const char* path);
  static void on_written(void* outputs, const char* path, std::int32_t created);

  void expect(const std::string& path, bool renewed);
  void refuse_if_expected(const std::string& path);
  // Throws if a file that was written is missing.
  void refuse_if_gone();
  static void refuse_if_same(const std::string& path, const std::filesystem::path& output,
                             const std::filesystem::path& input);
  void make_folder(const std::filesystem::path& folder);

  bool overwrite_, committed_ = false;
  std::vector<std::filesystem::path> expected_, inputs_, gone_;
  std::map<std::filesystem::path, std::string> places_;   // expected files: resolved path to the path as named
  std::map<std::filesystem::path, std::string> parents_;  // folders that will hold them: folder to a file in it
  std::vector<std::filesystem::path> kept_;               // expected files that may not be replaced
  std::vector<std::filesystem::path> files_, folders_;    // in the order in which they were begun
  std::vector<std::filesystem::path> stay_;               // files passed to keep(): replaced when written again, never
                                                          // removed
  std::vector<Made> made_;
  std::mutex made_mutex_;
};

// Whole or not at all, like the library's files.
void write_text(const std::string& path, const std::string& text);

}  // namespace command
