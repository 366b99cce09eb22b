// One page about trainings, for a browser: the curves of log.csv, the sheets, the configuration, data and devices. It
// is whole in itself: nothing is fetched, and a file that is moved away shows the same.
#pragma once
#include <string>
#include <vector>

namespace vsplat {

// Writes `path` about the trainings in those folders, finished or not, as train_stages() leaves them. Of one: its
// report. Of several: their curves on the same axes, without sheets. What is missing or damaged in a folder is left out
// and told in the page. Error(usage) where no run is given, Error(file) where one is no folder or holds neither
// config.json nor log.csv, or where the page cannot be written.
void write_report(const std::vector<std::string>& runs, const std::string& path);

}  // namespace vsplat
