// Every file that a command is going to write, looked at before anything is computed, and taken back if it ends early.
#pragma once
#include <filesystem>
#include <string>
#include <vector>

namespace command {

class Outputs {
 public:
  explicit Outputs(bool overwrite) : overwrite_(overwrite) {}
  // Removes what was begun, unless commit() was called: files first, then the folders made for them.
  ~Outputs();
  Outputs(const Outputs&) = delete;
  Outputs& operator=(const Outputs&) = delete;

  // A file that will be written. UsageError where it is named twice or is one of the inputs; std::runtime_error where
  // it exists (unless overwriting), is no file, or its folder cannot be written. "" is no file.
  void expect(const std::string& path);
  // A file that is read: never written over, not even with --overwrite. UsageError where it is expected as an output.
  void input(const std::string& path);

  // A file of an earlier run that will be there no longer once all is written; nothing unless overwriting. UsageError
  // where it is one of the inputs.
  void expect_gone(const std::string& path);

  // Before writing `path`: makes its folder. Returns the path.
  std::string begin(const std::string& path);
  // All is written: keeps it, and removes what expect_gone() named.
  void commit();

 private:
  static void refuse_if_same(const std::string& path, const std::filesystem::path& output,
                             const std::filesystem::path& input);
  void make_folder(const std::filesystem::path& folder);

  bool overwrite_, committed_ = false;
  std::vector<std::filesystem::path> expected_, inputs_, gone_;
  std::vector<std::filesystem::path> files_, folders_;  // in the order they were begun
};

// Whole or not at all, through a temporary name beside it.
void write_text(const std::string& path, const std::string& text);

}  // namespace command
