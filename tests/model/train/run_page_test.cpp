#include "model/train/run_page.h"

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <nlohmann/json.hpp>

#include "tests/support/refusal.h"
#include "tests/support/temporary.h"

namespace vsplat {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;
using test::contents_of;
using test::expect_error;
using test::put_file;
using test::TemporaryFolder;

const std::string kHeader =
    "step,seconds,lr,temperature,loss,psnr,psnr_coarse,selected,most_selected,intersections,gradient_norm\n";
const std::string kPng = "\x89PNG\r\n\x1a\n";

std::string line(long step, double loss = 0.5) {
  return fmt::format("{},{:.1f},0.0004,0.9000,{:.6f},21.500,20.250,0.25000,{},4000,0.5\n", step,
                     2.0 * static_cast<double>(step), loss, step % 7);
}

void put_run(const std::string& folder, const std::string& log,
             const std::string& config = R"({"steps": 40, "batch": 2})") {
  fs::create_directories(folder + "/sheets");
  put_file(folder + "/config.json", config);
  put_file(folder + "/log.csv", log);
}

void put_sheet(const std::string& folder, long step, const std::string& contents) {
  put_file(fmt::format("{}/sheets/step-{:08d}.png", folder, step), contents);
}

// The page, and the data in it for its script.
std::string page_of(const std::vector<std::string>& runs) {
  const TemporaryFolder out;
  write_report(runs, out / "page.html");
  EXPECT_EQ(out.entries(), std::vector<std::string>{"page.html"});
  return contents_of(out / "page.html");
}

json data_in(const std::string& page) {
  const std::string opens = "<script type=\"application/json\" id=\"data\">", closes = "</script>";
  const std::size_t begin = page.find(opens);
  EXPECT_NE(begin, std::string::npos);
  const std::size_t at = begin + opens.size();
  return json::parse(page.substr(at, page.find(closes, at) - at));
}

json report(const std::vector<std::string>& runs) { return data_in(page_of(runs)); }

std::string all_notes(const json& data) {
  std::string out;
  for (const json& note : data["notes"]) out += note.get<std::string>() + "\n";
  return out;
}

TEST(Report, HoldsWhatIsLogged) {
  const TemporaryFolder run;
  put_run(run.path(), kHeader + line(10, 0.5) + line(20, 0.25));
  put_sheet(run.path(), 20, kPng + "abc");
  const json data = report({run.path()});
  ASSERT_EQ(data["runs"].size(), 1);
  const json& of_run = data["runs"][0];
  EXPECT_EQ(of_run["name"], fs::path(run.path()).filename().string());
  ASSERT_EQ(of_run["stages"].size(), 1);
  const json& log = of_run["stages"][0]["log"];
  EXPECT_EQ(log["merged"], 1);
  EXPECT_EQ(log["columns"]["step"], json({10.0, 20.0}));
  EXPECT_EQ(log["columns"]["loss"], json({0.5, 0.25}));
  EXPECT_EQ(log["columns"]["psnr_coarse"], json({20.25, 20.25}));
  EXPECT_EQ(of_run["stages"][0]["config"], json({{"steps", 40}, {"batch", 2}}));
  EXPECT_TRUE(of_run["stages"][0]["record"].is_null());
  EXPECT_EQ(of_run["sheets"], json::parse(R"([{"stage": 0, "step": 20, "png": "iVBORw0KGgphYmM="}])"));
  EXPECT_EQ(of_run["sheets_left_out"], 0);
  EXPECT_EQ(all_notes(data), "");
}

TEST(Report, FetchesNothing) {
  const TemporaryFolder run;
  put_run(run.path(), kHeader + line(10));
  const std::string page = page_of({run.path()});
  EXPECT_EQ(page.find("@DATA@"), std::string::npos);
  for (const char* elsewhere : {"<link", "src=\"", "@import", "fetch(", "XMLHttpRequest", "href="})
    EXPECT_EQ(page.find(elsewhere), std::string::npos) << elsewhere;
  for (std::size_t at = 0; (at = page.find("http", at)) != std::string::npos; ++at)
    EXPECT_TRUE(page.compare(at, 26, "http://www.w3.org/2000/svg") == 0 || page.compare(at, 10, "http-equiv") == 0)
        << page.substr(at, 60);
}

// Text from files and names never becomes markup of the page.
TEST(Report, WhatStrangersWroteStaysText) {
  const TemporaryFolder folder;
  const std::string run = folder / "run";
  put_run(run, kHeader + line(10),
          json({{"steps", 40}, {"fit", "</script><img src=x>"}, {"</ScRiPt>", "\xe2\x80\xa8"}}).dump());
  put_file(run + "/record.json", R"({"textures": "<!-- </script >", "data": [{"path": "&lt;"}]})");
  put_sheet(run, 10, kPng + "x");
  const std::string plain = page_of({run});
  fs::create_directories(folder / "a<");
  fs::rename(run, folder / "a<" + "/script><script>alert(1)<!--&\xff");
  const std::string hostile = page_of({folder / "a<" + "/script><script>alert(1)<!--&\xff"});
  const auto count = [](const std::string& text, const std::string& what) {
    int out = 0;
    for (std::size_t at = 0; (at = text.find(what, at)) != std::string::npos; ++at) ++out;
    return out;
  };
  for (const std::string& page : {plain, hostile}) {
    EXPECT_EQ(count(page, "</script"), 2);
    EXPECT_EQ(count(page, "<script"), 2);
    EXPECT_EQ(count(page, "<!--"), 0);
    EXPECT_EQ(count(page, "<img"), 0);
    const json data = data_in(page);
    EXPECT_EQ(data["runs"][0]["config"]["fit"], "</script><img src=x>");
    EXPECT_EQ(data["runs"][0]["stages"][0]["record"]["textures"], "<!-- </script >");
  }
  EXPECT_EQ(data_in(hostile)["runs"][0]["name"], "script><script>alert(1)<!--&\xef\xbf\xbd");
}

TEST(Report, DamagedLinesAreLeftOutAndTold) {
  const TemporaryFolder run;
  put_run(run.path(), kHeader + line(10) + "20,40\n" + "\n" + line(20, 0.25) + line(20, 0.125) +
                          "abc,1,1,1,1,1,1,1,1,1,1\n" + "30,60,1e-4,nan,inf,1,1,1,1,1,1\n" + std::string("\0\xff", 2) +
                          "\n" + line(40).substr(0, 12));
  const json data = report({run.path()});
  const json& columns = data["runs"][0]["stages"][0]["log"]["columns"];
  EXPECT_EQ(columns["step"], json({10.0, 20.0, 30.0}));
  EXPECT_EQ(columns["loss"], json({0.5, 0.25, nullptr}));
  EXPECT_EQ(columns["temperature"], json({0.9, 0.9, nullptr}));
  EXPECT_NE(all_notes(data).find("log.csv: 6 of its lines cannot be read"), std::string::npos) << all_notes(data);
}

TEST(Report, WhatIsMissingOrDamagedIsReported) {
  const TemporaryFolder folder;
  const std::string run = folder / "run";
  put_run(run, "");
  json data = report({run});
  EXPECT_TRUE(data["runs"][0]["stages"][0]["log"].is_null());
  EXPECT_NE(all_notes(data).find("log.csv: its first line"), std::string::npos) << all_notes(data);
  put_file(run + "/log.csv", kHeader);
  put_file(run + "/config.json", "{\"steps\": ");
  put_file(run + "/record.json", "[1]");
  data = report({run});
  EXPECT_EQ(data["runs"][0]["stages"][0]["log"]["columns"]["step"], json::array());
  EXPECT_TRUE(data["runs"][0]["config"].is_null());
  for (const char* words : {"config.json: is not valid JSON", "record.json: is no JSON object"})
    EXPECT_NE(all_notes(data).find(words), std::string::npos) << all_notes(data);
  // One of the two files is enough; without both it is not a run.
  fs::remove(run + "/config.json");
  EXPECT_EQ(report({run})["runs"][0]["stages"].size(), 1);
  put_file(run + "/config.json", "{}");
  fs::remove(run + "/log.csv");
  EXPECT_TRUE(report({run})["runs"][0]["stages"][0]["log"].is_null());
  fs::remove(run + "/config.json");
  const std::string page = folder / "page.html";
  expect_error(Status::file, {run, "neither config.json nor log.csv"}, [&] { write_report({run}, page); });
  expect_error(Status::file, {folder / "none", "no folder"}, [&] { write_report({folder / "none"}, page); });
  expect_error(Status::usage, {"at least one run"}, [&] { write_report({}, page); });
  EXPECT_FALSE(fs::exists(page));
  put_file(run + "/config.json", "{}");
  expect_error(Status::file, {"nowhere"}, [&] { write_report({run}, folder / "nowhere/page.html"); });
}

TEST(Report, StagesStandOneAfterAnother) {
  const TemporaryFolder run;
  for (int i = 1; i <= 3; ++i) {
    const std::string stage = run / fmt::format("stage-{}", i);
    put_run(stage, kHeader + line(10 * i), fmt::format("{{\"steps\": {}}}", 10 * i));
    put_sheet(stage, 10 * i, kPng + "s");
  }
  put_file(run / "config.json", R"({"stages": [{"steps": 10}, {"steps": 20}]})");  // a third stage remains from before
  const auto steps = [](const json& of_run) {
    std::vector<double> out;
    for (const json& stage : of_run["stages"]) out.push_back(stage["log"]["columns"]["step"][0]);
    return out;
  };
  json of_run = report({run.path()})["runs"][0];
  EXPECT_EQ(steps(of_run), (std::vector<double>{10, 20}));
  EXPECT_EQ(of_run["stages"][1]["config"]["steps"], 20);
  ASSERT_EQ(of_run["sheets"].size(), 2);
  EXPECT_EQ(of_run["sheets"][1]["stage"], 1);
  fs::remove(run / "config.json");
  EXPECT_EQ(steps(report({run.path()})["runs"][0]), (std::vector<double>{10, 20, 30}));
}

TEST(Report, ALongLogIsMerged) {
  const TemporaryFolder run;
  std::string log = kHeader;
  for (long step = 1; step <= 5001; ++step) log += line(step, step % 3 == 0 ? 0.3 : 0.6);
  put_run(run.path(), log);
  const json of_log = report({run.path()})["runs"][0]["stages"][0]["log"];
  EXPECT_EQ(of_log["merged"], 3);
  const json& columns = of_log["columns"];
  ASSERT_EQ(columns["step"].size(), 1667);
  EXPECT_EQ(columns["step"][0], 3.0);
  EXPECT_EQ(columns["step"][1666], 5001.0);
  EXPECT_EQ(columns["seconds"][0], 6.0);
  EXPECT_EQ(columns["loss"][0], 0.5);
  EXPECT_EQ(columns["most_selected"][1], 6.0);  // the maximum of 4, 5 and 6
}

TEST(Report, SheetsAreBoundedAndNothingElse) {
  const TemporaryFolder folder;
  const std::string run = folder / "run";
  put_run(run, kHeader + line(10));
  for (long step = 1; step <= 30; ++step) put_sheet(run, step, kPng + std::string(1 << 20, 'x'));
  put_file(run + "/sheets/step-x.png", kPng + "no step");
  put_file(run + "/sheets/notes.txt", "none");
  const std::string page = page_of({run});
  EXPECT_LT(page.size(), std::size_t{17} << 20);
  json of_run = data_in(page)["runs"][0];
  ASSERT_GE(of_run["sheets"].size(), 9);
  ASSERT_LE(of_run["sheets"].size(), 12);
  EXPECT_EQ(of_run["sheets_left_out"], 30 - of_run["sheets"].size());
  EXPECT_EQ(of_run["sheets"].front()["step"], 1);
  EXPECT_EQ(of_run["sheets"].back()["step"], 30);
  // Rejected sheets: a link out of the run, a file that is no picture, and one that is too large.
  fs::remove_all(run + "/sheets");
  fs::create_directories(run + "/sheets");
  put_file(folder / "secret.png", kPng + "secret");
  fs::create_symlink(folder / "secret.png", run + "/sheets/step-00000001.png");
  put_sheet(run, 2, "no picture at all");
  put_sheet(run, 3, kPng + std::string(13 << 20, 'x'));
  of_run = report({run})["runs"][0];
  EXPECT_EQ(of_run["sheets"].size(), 0);
  EXPECT_EQ(of_run["sheets_left_out"], 2);
}

TEST(Report, SeveralRunsAreDistinguished) {
  const TemporaryFolder folder;
  for (const char* run : {"a/run", "b/run", "c"}) put_run(folder / run, kHeader + line(10));
  put_sheet(folder / "c", 10, kPng + "s");
  const json data = report({folder / "a/run", folder / "b/run", folder / "c/"});
  ASSERT_EQ(data["runs"].size(), 3);
  EXPECT_EQ(data["runs"][0]["name"], folder / "a/run");
  EXPECT_EQ(data["runs"][1]["name"], folder / "b/run");
  EXPECT_EQ(data["runs"][2]["name"], "c");
  EXPECT_TRUE(data["runs"][2]["sheets"].empty());
}

}  // namespace
}  // namespace vsplat
