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
    : title_(std::move(title)), cameras_(std::move(cameras)), begun_(elapsed_seconds()) {
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

void LiveFit::show(std::shared_ptr<const LiveVersion> version, double begun) {
  {
    const std::lock_guard lock(mutex_);
    version_ = std::move(version);
    ++number_;
  }
  const double now = elapsed_seconds(), cost = now - begun;
  spent_ += cost;
  // Then the next one, if it costs as much, does not exceed the share either.
  next_ = std::max(now + least_seconds, begun_ + (spent_ + cost) / most_share);
}

std::string LiveFit::scene_page(const LiveVersion& version) const {
  ScenePage out;
  out.title = title_;
  out.scenes = {{"fit", version.scene}};
  out.cameras = cameras_;
  out.quiet = true;
  return scene_page_text(out, title_);
}

std::string LiveFit::fit_page(const LiveVersion& version) const {
  FitPage out = version.page;
  out.settings = &version.settings;
  for (const LiveDrawing& each : version.drawings) {
    vsplat_comparison scores = VSPLAT_COMPARISON_INIT;
    vsplat::check(vsplat_compare(each.drawn.colour.data(), each.given.colour.data(), each.given.width,
                                 each.given.height, &scores, nullptr));
    out.pictures.push_back(fitted_picture(each.name, scores, each.given, each.drawn));
  }
  return fit_page_text(out);
}

std::string LiveFit::spz(const LiveVersion& version) const {
  const std::vector<unsigned char> bytes = page_spz({"fit", version.scene}, title_, true);
  return {bytes.begin(), bytes.end()};
}

// The earlier version's file if the latest one's cannot be made.
std::shared_ptr<const std::string> LiveFit::latest(File& file, std::string (LiveFit::*make)(const LiveVersion&) const) {
  int number = 0;
  std::shared_ptr<const LiveVersion> version;
  {
    const std::lock_guard lock(mutex_);
    number = number_, version = version_;
  }
  if (!version || file.version == number) return file.text;
  file.version = number;
  try {
    file.text = std::make_shared<const std::string>((this->*make)(*version));
  } catch (const std::exception& e) {
    warn(std::string("the live page shows an earlier step: ") + e.what());
  }
  return file.text;
}

// On the server's thread.
vsplat::sys::HttpAnswer LiveFit::answer(const std::string& path) {
  asked_ = elapsed_seconds();
  if (path == "/") return {html, std::make_shared<const std::string>(viewer_file("live.html"))};
  if (path == "/scene.html") return {html, latest(scene_page_, &LiveFit::scene_page)};
  if (path == "/fit.html") return {html, latest(fit_page_, &LiveFit::fit_page)};
  if (path == "/scene.spz") return {"application/octet-stream", latest(spz_, &LiveFit::spz)};
  if (path != "/state.json") return {};
  const std::lock_guard lock(mutex_);
  const nlohmann::ordered_json state = {{"title", title_}, {"text", text_}, {"share", share_}, {"version", number_}};
  return {"application/json",
          std::make_shared<const std::string>(state.dump(-1, ' ', false, nlohmann::json::error_handler_t::replace))};
}

}  // namespace command
