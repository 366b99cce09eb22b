#include "live_fit.h"

#include <algorithm>
#include <nlohmann/json.hpp>
#include <stdexcept>
#include <utility>

#include "arguments.h"
#include "scene_page.h"

namespace command {
namespace {

constexpr double most_share = 0.02;  // of the fit's time
constexpr double least_seconds = 2;  // from one scene to the next
constexpr double patience = 5;       // seconds without a request after which no browser is there
constexpr int ports_tried = 20, most_port = 65535;

const char* const html = "text/html; charset=utf-8";

int port_of(const std::string& text) {
  const int port = is_digits(text) && text.size() < 6 ? std::stoi(text) : 0;
  if (port < 1 || port > most_port)
    throw UsageError("--live is \"" + text + "\": a port expected, a whole number from 1 to " +
                     std::to_string(most_port));
  return port;
}

}  // namespace

LiveFit::LiveFit(const Common& common, const std::string& port, std::string title, std::vector<PageCamera> cameras)
    : title_(std::move(title)), cameras_(std::move(cameras)) {
  const bool any = port == "auto";
  const int first = any ? first_live_port : port_of(port);
  std::error_code error;
  for (int i = 0; i < (any ? ports_tried : 1); ++i) {
    server_ = std::make_unique<vsplat::sys::HttpServer>(
        first + i, [this](const std::string& path) { return answer(path); }, error);
    if (!error) break;
  }
  const std::string address = "http://127.0.0.1:" + std::to_string(any && !error ? server_->port() : first) + "/";
  if (error)
    throw std::runtime_error(
        "--live: " + address + ": " + error.message() +
        (any ? ", nor is one of the next " + std::to_string(ports_tried - 1) + " ports free" : ": give another port"));
  say(common, address + " shows the fit while it runs");
}

void LiveFit::at(const std::string& text, double share) {
  const std::lock_guard lock(mutex_);
  text_ = text;
  share_ = share;
}

bool LiveFit::is_due() const {
  const double now = elapsed_seconds();
  return now >= next_ && now - asked_ < patience;
}

void LiveFit::show(const vsplat::Scene& scene, const FitPage& page, double begun) {
  ScenePage about;
  about.title = title_;
  about.scenes = {{"fit", scene}};
  about.cameras = cameras_;
  about.quiet = true;
  const auto spz = page_spz(about.scenes[0], title_, true);
  auto file = std::make_shared<const std::string>(spz.begin(), spz.end());
  std::shared_ptr<const std::string> scene_page = scene_page_;
  if (!scene_page) scene_page = std::make_shared<const std::string>(scene_page_text(about, title_));
  auto fit_page = std::make_shared<const std::string>(fit_page_text(page));
  {
    const std::lock_guard lock(mutex_);
    scene_page_ = std::move(scene_page);
    scene_ = std::move(file);
    fit_page_ = std::move(fit_page);
    ++version_;
  }
  const double now = elapsed_seconds();
  next_ = now + std::max(least_seconds, (now - begun) / most_share);
}

// On the server's thread.
vsplat::sys::HttpAnswer LiveFit::answer(const std::string& path) {
  asked_ = elapsed_seconds();
  if (path == "/") return {html, std::make_shared<const std::string>(viewer_file("live.html"))};
  const std::lock_guard lock(mutex_);
  if (path == "/scene.html") return {html, scene_page_};
  if (path == "/fit.html") return {html, fit_page_};
  if (path == "/scene.spz") return {"application/octet-stream", scene_};
  if (path != "/state.json") return {};
  const nlohmann::ordered_json state = {{"title", title_}, {"text", text_}, {"share", share_}, {"version", version_}};
  return {"application/json",
          std::make_shared<const std::string>(state.dump(-1, ' ', false, nlohmann::json::error_handler_t::replace))};
}

}  // namespace command
