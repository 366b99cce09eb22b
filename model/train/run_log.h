// Reads a training's log.csv for plotting.
#pragma once
#include <map>
#include <string>
#include <vector>

namespace vsplat {

struct RunLog {
  // The known columns by name, one value a point. "step" and "seconds" are always present. Values that are not finite
  // are NaN.
  std::map<std::string, std::vector<double>> columns;
  // lines merged into a point: counts are the maximum, step, time and rates the last value, others the mean
  long merged = 1;
  long damaged = 0;  // lines skipped: wrong number of fields, not numbers, or steps that do not increase
};

// Returns at most 2000 points. Error(file) if the file cannot be read. Error(format) if its first line lacks the
// columns "step" and "seconds", or if it is too large for a log.
RunLog read_run_log(const std::string& path);

}  // namespace vsplat
