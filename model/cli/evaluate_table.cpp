// vsplat evaluate --table: every system on every data set under every protocol, a row each.
#include "evaluate_table.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <optional>
#include <set>
#include <sstream>
#include <tuple>
#include <vsplat/vsplat.hpp>

#include "outputs.h"
#include "session.h"

namespace command {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;
using nlohmann::ordered_json;

constexpr std::uintmax_t kLargestFile = 1 << 20;
constexpr const char* kLpipsFiles[] = {"alex.safetensors", "vgg.safetensors"};
constexpr const char* kEndings[] = {".md", ".csv", ".json"};

struct System {
  std::string name, model;  // the model file; "": the built-in model
};
struct Data {
  std::string name;
  std::vector<std::string> folders;
};
struct Views {
  std::string name;
  vsplat_evaluate_options options = VSPLAT_EVALUATE_OPTIONS_INIT;
};
struct TableRequest {
  std::vector<System> systems;
  std::vector<Data> data;
  std::vector<Views> views;
  int size = 0;
  std::string lpips;
};

// Fields of a JSON object in the file. Paths are relative to the file's folder.
class Fields {
 public:
  Fields(const json& object, std::string where, fs::path folder)
      : object_(object), where_(std::move(where)), folder_(std::move(folder)) {
    if (!object_.is_object()) wrong(where_, "an object", object_);
  }

  std::string text(const char* name, const std::optional<std::string>& otherwise = {}) {
    const json* value = find(name, !otherwise.has_value());
    if (!value) return *otherwise;
    if (!value->is_string() || value->get<std::string>().empty()) wrong(told(name), "a text that is not empty", *value);
    return value->get<std::string>();
  }
  // `first` if the field is missing.
  std::string one_of_two(const char* name, const char* first, const char* second) {
    const json* value = find(name, false);
    if (!value) return first;
    if (*value != first && *value != second) wrong(told(name), std::string(first) + " or " + second, *value);
    return value->get<std::string>();
  }
  std::string path(const char* name) {
    const std::string given = text(name, "");
    return given.empty() ? "" : (folder_ / given).string();
  }
  std::vector<std::string> paths(const char* name) {
    const json& list = *find(name, true);
    if (!list.is_array() || list.empty()) wrong(told(name), "a list of folders", list);
    std::vector<std::string> out;
    for (const json& each : list) {
      if (!each.is_string() || each.get<std::string>().empty()) wrong(told(name), "a list of folders", list);
      out.push_back((folder_ / each.get<std::string>()).string());
    }
    return out;
  }
  double number(const char* name, double low, double high, double otherwise) {
    const json* value = find(name, false);
    if (!value) return otherwise;
    if (!value->is_number() || !(value->get<double>() >= low && value->get<double>() <= high))
      wrong(told(name), "a number from " + json(low).dump() + " to " + json(high).dump(), *value);
    return value->get<double>();
  }
  std::uint64_t count(const char* name, std::uint64_t low, std::uint64_t high, std::uint64_t otherwise) {
    const json* value = find(name, false);
    if (!value) return otherwise;
    if (!value->is_number_unsigned() || value->get<std::uint64_t>() < low || value->get<std::uint64_t>() > high)
      wrong(told(name), "a whole number from " + std::to_string(low) + " to " + std::to_string(high), *value);
    return value->get<std::uint64_t>();
  }
  template <class Each>
  void objects(const char* name, bool needed, const Each& each) {
    const json* list = find(name, needed);
    if (!list) return;
    if (!list->is_array() || list->empty()) wrong(told(name), "a list of objects", *list);
    for (std::size_t i = 0; i < list->size(); ++i) {
      Fields fields((*list)[i], told(name) + "[" + std::to_string(i) + "]", folder_);
      each(fields);
      fields.end();
    }
  }
  // Fails if any other field is present.
  void end() const {
    for (const auto& [name, value] : object_.items())
      if (!known_.contains(name)) {
        std::string all;
        for (const std::string& each : known_) all += (all.empty() ? "" : ", ") + each;
        throw std::runtime_error(told(name) + ": no such field; there are " + all);
      }
  }

 private:
  const json* find(const char* name, bool needed) {
    known_.insert(name);
    const auto found = object_.find(name);
    if (found != object_.end()) return &*found;
    if (needed) throw std::runtime_error(told(name) + " is missing");
    return nullptr;
  }
  std::string told(const std::string& name) const { return where_ + (where_.ends_with(": ") ? "" : ".") + name; }
  [[noreturn]] static void wrong(const std::string& where, const std::string& expected, const json& found) {
    std::string text = found.dump(-1, ' ', true, json::error_handler_t::replace);
    if (text.size() > 60) text = text.substr(0, 60) + "...";
    throw std::runtime_error(where + " must be " + expected + " (found " + text + ")");
  }

  const json& object_;
  std::string where_;
  fs::path folder_;
  std::set<std::string> known_;
};

json parsed(const std::string& path) {
  std::error_code error;
  if (!fs::is_regular_file(path, error))
    throw std::runtime_error(path + ": is not a file; a list of what to measure is expected");
  if (fs::file_size(path, error) > kLargestFile)
    throw std::runtime_error(path + ": more than 1 MiB, too much for a list of what to measure");
  std::ifstream file(path, std::ios::binary);
  std::ostringstream text;
  text << file.rdbuf();
  if (!file) throw std::runtime_error(path + ": cannot be read");
  try {
    return json::parse(text.str());
  } catch (const json::exception& e) {
    throw std::runtime_error(path + ": not valid JSON: " + e.what());
  }
}

vsplat_evaluate_options read_options(Fields& fields) {
  vsplat_evaluate_options out = VSPLAT_EVALUATE_OPTIONS_INIT;
  const bool random = fields.one_of_two("protocol", "kmeans", "random10") == "random10";
  out.protocol = random ? VSPLAT_PROTOCOL_RANDOM10 : VSPLAT_PROTOCOL_KMEANS;
  out.view_count = static_cast<int32_t>(fields.count("inputs", 1, 16, 0));
  out.seed = fields.count("seed", 0, UINT64_MAX, 0);
  out.pose_noise = fields.number("pose_noise", 0, 1, 0);
  out.pose_draws = static_cast<int32_t>(fields.count("pose_draws", 1, 1000, 1));
  return out;
}

TableRequest read(const std::string& path) {
  const json file = parsed(path);
  Fields fields(file, path + ": ", fs::path(path).parent_path());
  TableRequest out;
  fields.objects("systems", true, [&](Fields& of) {
    System system;
    system.name = of.text("name"), system.model = of.path("model");
    out.systems.push_back(std::move(system));
  });
  fields.objects("data", true, [&](Fields& of) {
    Data data;
    data.name = of.text("name"), data.folders = of.paths("folders");
    out.data.push_back(std::move(data));
  });
  fields.objects("views", false, [&](Fields& of) {
    Views views;
    views.name = of.text("name");
    views.options = read_options(of);
    out.views.push_back(std::move(views));
  });
  if (out.views.empty()) out.views.push_back({"usual", VSPLAT_EVALUATE_OPTIONS_INIT});
  out.size = static_cast<int>(fields.count("size", 11, 4096, 0));
  out.lpips = fields.path("lpips");
  fields.end();
  return out;
}

struct Row {
  std::size_t data, views, system;
  vsplat_scores mean;
  double seconds;        // median over the objects, since the first includes compiling
  std::uint64_t memory;  // bytes, planned
  std::size_t objects, skipped;
};

struct Cell {
  const char *name, *heading;
  double value;
  int digits;
};

// The cells of a row. LPIPS only if there are weights.
std::vector<Cell> cells_of(const Row& row) {
  constexpr double mib = 1 << 20;
  std::vector<Cell> out = {{"psnr", "PSNR", row.mean.psnr, 2},
                           {"ssim", "SSIM", row.mean.ssim, 4},
                           {"lpips_alex", "LPIPS alex", row.mean.lpips_alex, 4},
                           {"lpips_vgg", "LPIPS vgg", row.mean.lpips_vgg, 4},
                           {"seconds", "seconds", row.seconds, 3},
                           {"gaussians", "Gaussians", row.mean.gaussians, 0},
                           {"memory_mib", "memory MiB", static_cast<double>(row.memory) / mib, 0},
                           {"objects", "objects", static_cast<double>(row.objects), 0},
                           {"skipped", "left out", static_cast<double>(row.skipped), 0}};
  std::erase_if(out,
                [](const Cell& cell) { return std::string(cell.name).starts_with("lpips") && std::isnan(cell.value); });
  return out;
}

std::string fixed(const Cell& cell) {
  char text[64];
  std::snprintf(text, sizeof text, "%.*f", cell.digits, cell.value);
  return text;
}

class Table {
 public:
  explicit Table(const TableRequest& request) : request_(request) {}

  void add(Row row) {
    rows_.push_back(std::move(row));
    std::stable_sort(rows_.begin(), rows_.end(), [](const Row& a, const Row& b) {
      return std::tie(a.data, a.views, a.system) < std::tie(b.data, b.views, b.system);
    });
  }
  std::size_t size() const { return rows_.size(); }

  std::string markdown() const {
    return lines("| ", " | ", " |\n", [](const std::string& text) {
      std::string out;
      for (const char c : text) out += c == '|' ? "\\|" : std::string(1, c == '\n' || c == '\r' ? ' ' : c);
      return out;
    });
  }
  std::string csv() const {
    return lines("", ",", "\n", [](const std::string& text) {
      if (text.find_first_of(",\"\r\n") == std::string::npos) return text;
      std::string out = "\"";
      for (const char c : text) out += c == '"' ? "\"\"" : std::string(1, c);
      return out + "\"";
    });
  }
  ordered_json to_json() const {
    ordered_json rows = ordered_json::array();
    for (const Row& row : rows_) {
      ordered_json out;
      const std::vector<std::string> named = names(row);
      for (std::size_t i = 0; i < named.size(); ++i) out[kNames[i]] = named[i];
      for (const Cell& cell : cells_of(row))
        out[cell.name] = !std::isfinite(cell.value) ? ordered_json()
                         : cell.digits == 0         ? ordered_json(std::llround(cell.value))
                                                    : ordered_json(cell.value);
      rows.push_back(std::move(out));
    }
    return {{"rows", rows}};
  }
  std::string text(const std::string& path) const {
    if (path.ends_with(".md")) return markdown();
    return path.ends_with(".csv") ? csv()
                                  : to_json().dump(1, ' ', false, ordered_json::error_handler_t::replace) + "\n";
  }

 private:
  static constexpr const char* kNames[] = {"data", "views", "system"};

  std::vector<std::string> names(const Row& row) const {
    return {request_.data[row.data].name, request_.views[row.views].name, request_.systems[row.system].name};
  }

  template <class Quoted>
  std::string lines(const std::string& begin, const std::string& between, const std::string& end,
                    const Quoted& quoted) const {
    const bool ruled = !begin.empty();
    std::string out, rule;
    const auto line = [&](const std::vector<std::string>& words) {
      std::string all;
      for (const std::string& word : words) all += (all.empty() ? begin : between) + quoted(word);
      out += all + end;
    };
    for (const Row& row : rows_) {
      const std::vector<Cell> cells = cells_of(row);
      std::vector<std::string> words = names(row);
      if (out.empty()) {
        std::vector<std::string> headings(std::begin(kNames), std::end(kNames));
        for (const Cell& cell : cells) headings.emplace_back(ruled ? cell.heading : cell.name);
        line(headings);
        if (ruled) {
          for (std::size_t i = 0; i < headings.size(); ++i) out += i < std::size(kNames) ? "| --- " : "| ---: ";
          out += "|\n";
        }
      }
      for (const Cell& cell : cells) words.push_back(fixed(cell));
      line(words);
    }
    return out;
  }

  const TableRequest& request_;
  std::vector<Row> rows_;
};

double median_seconds(const vsplat::Evaluation& evaluation) {
  std::vector<double> all;
  for (const auto& object : evaluation.objects()) all.push_back(object.scores.seconds);
  const auto middle = all.begin() + static_cast<std::ptrdiff_t>((all.size() - 1) / 2);
  std::nth_element(all.begin(), middle, all.end());
  return *middle;
}

vsplat_plan plan_of(const Session& session, const vsplat::Model& model, const vsplat_evaluate_options& options) {
  vsplat_plan out = VSPLAT_PLAN_INIT;
  const int32_t views = options.view_count ? options.view_count : model.info().views;
  vsplat::check(vsplat_plan_reconstruct(session.device().get(), model.get(), views, 0, &out));
  return out;
}

std::string row_name(const TableRequest& of, std::size_t system, std::size_t data, std::size_t views) {
  return of.systems[system].name + " on " + of.data[data].name + ", " + of.views[views].name;
}

Row measured(Session& session, const vsplat::Model& model, const vsplat::DataSet& data,
             const vsplat_evaluate_options& options) {
  const vsplat::Evaluation evaluation(session.device(), model, data, options);
  return {0,
          0,
          0,
          evaluation.mean(),
          median_seconds(evaluation),
          plan_of(session, model, options).peak,
          evaluation.objects().size(),
          evaluation.skipped()};
}

void print(const Common& common, const Table& table) {
  clear_progress();
  if (common.json)
    print_json(table.to_json());
  else
    std::fputs(for_terminal(table.markdown()).c_str(), stdout);
}

// Plans the memory of each row's network. Opens everything that the table reads, except the objects' pictures and the
// LPIPS weights.
void plan_table(const Common& common, const TableRequest& request) {
  Session session(common);
  std::vector<vsplat::DataSet> sets;
  for (const Data& data : request.data) sets.emplace_back(data.folders);
  std::error_code ignored;
  if (!request.lpips.empty() && std::none_of(std::begin(kLpipsFiles), std::end(kLpipsFiles), [&](const char* name) {
        return fs::exists(fs::path(request.lpips) / name, ignored);
      }))
    throw std::runtime_error(request.lpips + ": has neither " + kLpipsFiles[0] + " nor " + kLpipsFiles[1] +
                             ", the weights of LPIPS");
  std::vector<Plan> plans;
  for (std::size_t s = 0; s < request.systems.size(); ++s) {
    const vsplat::Model model = load_model(request.systems[s].model);
    for (std::size_t d = 0; d < sets.size(); ++d)
      for (std::size_t v = 0; v < request.views.size(); ++v) {
        const std::size_t count = sets[d].count();
        const std::string name = row_name(request, s, d, v);
        try {
          plans.push_back({name + ": " + std::to_string(count) + (count == 1 ? " object" : " objects"),
                           plan_of(session, model, request.views[v].options)});
        } catch (const vsplat::Error& e) {
          throw vsplat::Error(e.status(), (name + ": " + e.what()).c_str());
        }
      }
  }
  print_plans(common, plans);
}

}  // namespace

void evaluate_table(const Common& common, const TableOptions& o) {
  for (const std::string& path : o.outputs)
    if (std::none_of(std::begin(kEndings), std::end(kEndings), [&](const char* e) { return path.ends_with(e); }))
      throw UsageError("--output is " + path + ": a file ending in .md, .csv or .json is expected");
  set_up_library(common);
  const TableRequest request = read(o.file);
  if (o.dry_run) {
    refuse_profile_of_dry_run(common);
    if (!o.outputs.empty()) throw UsageError("--dry-run measures nothing: there is no table to be written to --output");
    return plan_table(common, request);
  }
  Common own = common;
  if (join_ranks(own).several())
    throw UsageError("--table takes one process: only the devices of --device share the objects of its rows");
  Outputs outputs(common.overwrite);
  outputs.input(o.file);
  for (const System& system : request.systems) outputs.input(system.model);
  for (const std::string& path : o.outputs) outputs.expect(path);
  for (const std::string& path : {common.profile, common.trace}) outputs.expect(path);
  for (const Data& data : request.data) outputs.input_data(data.folders);

  Session session(common, Devices::several);
  session.about("command", "evaluate");
  session.about("table", o.file);
  std::vector<vsplat::DataSet> sets;  // all are opened before anything is computed
  for (const Data& data : request.data) sets.emplace_back(data.folders);
  Table table(request);
  const std::size_t all = request.systems.size() * request.data.size() * request.views.size();
  for (std::size_t s = 0; s < request.systems.size(); ++s) {
    const vsplat::Model model = load_model(request.systems[s].model);
    for (std::size_t d = 0; d < sets.size(); ++d)
      for (std::size_t v = 0; v < request.views.size(); ++v) {
        const std::string what = row_name(request, s, d, v);
        vsplat_evaluate_options options = request.views[v].options;
        options.picture_size = request.size;
        options.lpips = request.lpips.empty() ? nullptr : request.lpips.c_str();
        options.skip_bad = o.skip_bad;
        options.progress = Session::on_progress;
        options.user = &session;
        session.share(options);
        session.start(what);
        try {
          Row row = measured(session, model, sets[d], options);
          row.data = d, row.views = v, row.system = s;
          table.add(std::move(row));
        } catch (const vsplat::Error& e) {  // finished rows are printed
          if (table.size() > 0) print(common, table);
          if (e.status() == VSPLAT_ERROR_CANCELLED)
            throw std::runtime_error("interrupted after " + std::to_string(table.size()) + " of " +
                                     std::to_string(all) + " rows");
          throw vsplat::Error(e.status(), (what + ": " + e.what()).c_str());
        }
      }
  }
  for (const std::string& path : o.outputs) write_text(outputs.begin(path), table.text(path));
  session.write_profile(outputs);
  outputs.commit();
  print(common, table);
  say(common, std::to_string(all) + (all == 1 ? " row, " : " rows, ") + seconds_text(elapsed_seconds()));
}

}  // namespace command
