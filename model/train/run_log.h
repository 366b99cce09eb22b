// A training's log.csv, read for drawing.
#pragma once
#include <map>
#include <string>
#include <vector>

namespace vsplat {

struct RunLog {
  // By their names those that are known, one value a point: "step" and "seconds" are always there. What is no finite
  // number is NaN.
  std::map<std::string, std::vector<double>> columns;
  long merged = 1;   // lines a point stands for: means, but of counts the largest, and of step, time and rates the last
  long damaged = 0;  // lines left out: not as many fields as the first, no numbers, or steps that do not rise
};

// At most 2000 points. Error(file) where it cannot be read, Error(format) where its first line names no columns "step"
// and "seconds", or where it is too large to be one.
RunLog read_run_log(const std::string& path);

}  // namespace vsplat
