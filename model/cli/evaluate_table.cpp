// vsplat evaluate --table: every system on every data set under every protocol, a row each.
#include "evaluate_table.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <tuple>
#include <vsplat/vsplat.hpp>

#include "outputs.h"
#include "request_fields.h"
#include "session.h"
#include "table_text.h"

namespace command {
namespace {

namespace fs = std::filesystem;
using nlohmann::ordered_json;

constexpr const char* kLpipsFiles[] = {"alex.safetensors", "vgg.safetensors"};

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
  const ordered_json file = parsed_file(path, "a list of what to measure");
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

  void add(const Row& row) {
    rows_.push_back(row);
    std::stable_sort(rows_.begin(), rows_.end(), [](const Row& a, const Row& b) {
      return std::tie(a.data, a.views, a.system) < std::tie(b.data, b.views, b.system);
    });
  }
  std::size_t size() const { return rows_.size(); }

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
  // The headings, then the rows.
  TableLines lines() const {
    TableLines out;
    out.texts = std::size(kNames);
    for (const Row& row : rows_) {
      const std::vector<Cell> cells = cells_of(row);
      if (out.names.empty()) {
        out.names.assign(std::begin(kNames), std::end(kNames));
        out.headings = out.names;
        for (const Cell& cell : cells) out.names.emplace_back(cell.name), out.headings.emplace_back(cell.heading);
      }
      out.rows.push_back(names(row));
      for (const Cell& cell : cells) out.rows.back().push_back(fixed(cell));
    }
    return out;
  }
  std::string text(const std::string& path) const { return table_file(path, lines(), to_json()); }

 private:
  static constexpr const char* kNames[] = {"data", "views", "system"};

  std::vector<std::string> names(const Row& row) const {
    return {request_.data[row.data].name, request_.views[row.views].name, request_.systems[row.system].name};
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
    std::fputs(for_terminal(markdown(table.lines())).c_str(), stdout);
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
  for (const std::string& path : o.outputs) need_table_ending(path);
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
          table.add(row);
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
