// The page of a fit in progress: the scene in the viewer, and the fit's page, served to browsers of this computer. It
// costs the fit's thread at most 2 % of its time, and nothing while no browser asks. Files and pictures are encoded by
// the server's thread, when a browser asks for them.
#pragma once
#include <atomic>
#include <memory>
#include <mutex>
#include <nlohmann/json.hpp>
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

struct LiveDrawing {
  std::string name;
  vsplat::Picture given, drawn;
};

// What the page shows from some step on.
struct LiveVersion {
  vsplat::Scene scene;
  FitPage page;  // without its pictures and settings, which follow
  nlohmann::ordered_json settings;
  std::vector<LiveDrawing> drawings;
};

class LiveFit {
 public:
  // `port` of --live: "auto", or a number; UsageError for anything else. Throws if the port is another program's. Says
  // where the page is. `cameras` are shown beside the scene.
  LiveFit(const Common& common, const std::string& port, std::string title, std::vector<PageCamera> cameras);

  // After each step: the progress line, and the share of the steps that are done.
  void at(const std::string& text, double share);
  // Whether a browser waits for a newer scene, which the fit may take the time to give.
  bool is_due() const;
  // Seconds that the fit has spent on what was shown, and how many scenes that were.
  double spent() const { return spent_; }
  int versions() const { return number_; }
  // Shows this from now on. `begun`: elapsed_seconds() when the caller began to prepare it.
  void show(std::shared_ptr<const LiveVersion> version, double begun);

 private:
  // A file of the latest version, made when it is asked for first. Only the server's thread uses it.
  struct File {
    int version = 0;
    std::shared_ptr<const std::string> text;
  };

  vsplat::sys::HttpAnswer answer(const std::string& path);
  std::shared_ptr<const std::string> latest(File& file, std::string (LiveFit::*make)(const LiveVersion&) const);
  std::string scene_page(const LiveVersion& version) const;
  std::string fit_page(const LiveVersion& version) const;
  std::string spz(const LiveVersion& version) const;

  std::string title_;
  std::vector<PageCamera> cameras_;
  double begun_;                      // elapsed_seconds() at the beginning
  double spent_ = 0, next_ = 0;       // seconds of the fit's thread; elapsed_seconds() before which nothing is shown
  std::atomic<double> asked_ = -1e9;  // elapsed_seconds() at the last request
  File scene_page_, fit_page_, spz_;
  std::mutex mutex_;  // of what follows
  std::string text_ = "reading pictures";
  double share_ = 0;
  int number_ = 0;  // of the version; 0: there is none yet
  std::shared_ptr<const LiveVersion> version_;
  std::unique_ptr<vsplat::sys::HttpServer> server_;  // ends before what it reads
};

}  // namespace command
