// What a self-test is doing, in a file of the cache's folder: a driver may end the process, or the whole machine, and
// the next self-test passes over what it was at then. The file is there while a self-test is under way, and stays
// where one was ended.
#pragma once
#include <map>
#include <memory>
#include <mutex>
#include <string>

#include "runtime/device.h"
#include "runtime/files/folder_lock.h"

namespace vsplat::selftest {

class Journal {
 public:
  // In `folder`, which is made; "": nothing is kept, and nothing is known. `ended` tells how the process ended that
  // wrote there last, where somebody has seen it: what it was at is to blame. Where nobody has ("") it may have been
  // stopped from outside, and is to blame once it has ended two. While another self-test holds the folder, nothing is
  // kept either.
  Journal(const std::string& folder, const std::string& ended);
  static std::string folder_of(const DeviceInfo& device);
  // What was under way is no more, since the process goes on; what ended others is known still.
  ~Journal();
  Journal(const Journal&) = delete;
  Journal& operator=(const Journal&) = delete;

  // How this is known to end a process, in words; "" where it is not.
  std::string ended_by(const std::string& doing) const;
  // Written before anything of it is done.
  void begins(const std::string& doing);
  // Of any thread.
  void compiles(const std::string& kernel);
  // All of it was done: what ended others has been told, and is tried again by the next self-test.
  void done();

 private:
  struct End {
    int times = 0;
    std::string how, kernel;  // empty: not known
  };
  bool read(const std::string& ended);
  void write();

  std::string path_;
  std::unique_ptr<FolderLock> lock_;
  mutable std::mutex mutex_;
  std::string doing_, kernel_;
  std::map<std::string, End> ends_;
};

}  // namespace vsplat::selftest
