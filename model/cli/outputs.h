// Every file that a command is going to write, looked at before anything is computed, and taken back if it ends early.
#pragma once
#include <cstdint>
#include <filesystem>
#include <map>
#include <mutex>
#include <string>
#include <vector>

#include "runtime/system/system.h"

namespace command {

// Whether files may name others that lie anywhere, for the whole process.
void allow_outside(bool allowed);

class Outputs {
 public:
  // There is one at a time: the library asks it what may be replaced, and tells it what it made.
  explicit Outputs(bool overwrite);
  // Removes what was begun and this process made, unless commit() was called: files first, then the folders made for
  // them.
  ~Outputs();
  Outputs(const Outputs&) = delete;
  Outputs& operator=(const Outputs&) = delete;

  // A file that will be written. UsageError where it is named twice, is one of the inputs or the folder of another one;
  // std::runtime_error where it exists (unless overwriting), is no file, or its folder cannot be written. "" is no
  // file.
  void expect(const std::string& path);
  // The same, of a file that an earlier run may have left for this one to go on with: it is replaced where it exists.
  void expect_renewed(const std::string& path);
  // A file that is read: never written over, not even with --overwrite. UsageError where it is expected as an output.
  void input(const std::string& path);

  // The same of a list of cameras, and of what lists them in a folder.
  void input_cameras(const std::string& path);
  // The same of all that data sets list; after what is expected.
  void input_data(const std::vector<std::string>& paths);

  // A file of an earlier run that will be there no longer once all is written; nothing unless overwriting. UsageError
  // where it is one of the inputs.
  void expect_gone(const std::string& path);

  // Before writing `path`: makes its folder. Returns the path.
  std::string begin(const std::string& path);
  // What was begun so far is written, and stays however the rest ends.
  void keep();
  // All is written: keeps it, and removes what expect_gone() named. Like keep(), std::runtime_error where something
  // else has removed what was written.
  void commit();

 private:
  // Of a file that this process made: what lies there later may be another's.
  struct Made {
    std::filesystem::path path;
    vsplat::sys::FileFacts facts;
    bool still_there() const;
  };
  static std::int32_t on_exists(void* outputs, const char* path);
  static void on_written(void* outputs, const char* path, std::int32_t created);

  void expect(const std::string& path, bool renewed);
  void refuse_if_expected(const std::string& path);
  // What was written is still there.
  void refuse_if_gone();
  static void refuse_if_same(const std::string& path, const std::filesystem::path& output,
                             const std::filesystem::path& input);
  void make_folder(const std::filesystem::path& folder);

  bool overwrite_, committed_ = false;
  std::vector<std::filesystem::path> expected_, inputs_, gone_;
  std::map<std::filesystem::path, std::string> places_;  // of those expected, by where they will lie: as they are named
  std::map<std::filesystem::path, std::string> parents_;  // the folders that they will lie in: what lies there
  std::vector<std::filesystem::path> kept_;               // of those expected: what may not be replaced
  std::vector<std::filesystem::path> files_, folders_;    // in the order they were begun
  std::vector<std::filesystem::path> stay_;               // of keep(): written anew they are replaced, never taken away
  std::vector<Made> made_;
  std::mutex made_mutex_;
};

// Whole or not at all, as the library writes its files.
void write_text(const std::string& path, const std::string& text);

}  // namespace command
