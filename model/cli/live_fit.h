// The page of a fit in progress: the scene in the viewer, and the fit's page, served to browsers of this computer. It
// costs the fit at most 2 % of its time, and nothing while no browser asks.
#pragma once
#include <atomic>
#include <memory>
#include <mutex>
#include <string>
#include <vector>
#include <vsplat/vsplat.hpp>

#include "command.h"
#include "fit_page.h"
#include "page_cameras.h"
#include "runtime/system/system_http.h"

namespace command {

// What browsers without a number get, or the next free port.
inline constexpr int first_live_port = 7007;

class LiveFit {
 public:
  // `port` of --live: "auto", or a number; UsageError for anything else. Throws if the port is another program's. Says
  // where the page is. `cameras` are shown beside the scene.
  LiveFit(const Common& common, const std::string& port, std::string title, std::vector<PageCamera> cameras);

  // After each step: the progress line, and the share of the steps that are done.
  void at(const std::string& text, double share);
  // Whether a browser waits for a newer scene, which the fit may take the time to give.
  bool is_due() const;
  // Shows this from now on. `begun`: elapsed_seconds() when the caller began to prepare it.
  void show(const vsplat::Scene& scene, const FitPage& page, double begun);

 private:
  vsplat::sys::HttpAnswer answer(const std::string& path);

  std::string title_;
  std::vector<PageCamera> cameras_;
  double next_ = 0;                   // elapsed_seconds() from which on a newer scene may be shown
  std::atomic<double> asked_ = -1e9;  // elapsed_seconds() at the last request
  std::mutex mutex_;                  // of what follows
  std::string text_ = "reading pictures";
  double share_ = 0;
  int version_ = 0;  // of the scene and the page; 0: there is none yet
  std::shared_ptr<const std::string> scene_page_, scene_, fit_page_;
  std::unique_ptr<vsplat::sys::HttpServer> server_;  // ends before what it reads
};

}  // namespace command
