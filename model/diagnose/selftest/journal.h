// Records what a self-test is doing in a file of the cache folder: a driver may end the process, or crash the machine,
// and the next self-test then skips what was running. The file exists while a self-test runs, and remains if one was
// ended.
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
  // Keeps the journal in `folder`, which is created; "": no journal. `ended`: how the process ended that last wrote
  // there, if someone observed it; what was running then is to blame. If it is unknown (""), the process may have been
  // stopped from outside, so something is only to blame after it has ended two. While another self-test holds the
  // folder, no journal is kept either.
  Journal(const std::string& folder, const std::string& ended);
  static std::string folder_of(const DeviceInfo& device);
  // Clears the entry in progress, since the process survived; earlier entries stay.
  ~Journal();
  Journal(const Journal&) = delete;
  Journal& operator=(const Journal&) = delete;

  // How this item ended a process, in words; "" if it is not known to.
  std::string ended_by(const std::string& doing) const;
  // Call before the item starts.
  void begins(const std::string& doing);
  // Any thread may call it.
  void compiles(const std::string& kernel);
  // Call when all is done: earlier ends have been reported, and the next self-test tries these items again.
  void done();

 private:
  struct End {
    int times = 0;
    std::string how, kernel;  // empty: unknown
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
