// The page about trainings, for a browser: the curves of log.csv, the sheets, the configuration, the data and the
// devices. It is self-contained: it fetches nothing, and it can be moved.
#pragma once
#include <string>
#include <vector>

namespace vsplat {

// Writes the page `path` about the trainings in these folders, finished or not, with the layout of train_stages(). For
// one run it is the run page; for several it shows their curves on common axes, without sheets. Missing or damaged
// files are left out, with a note on the page. Error(usage) if `runs` is empty. Error(file) if a run is not a folder or
// holds neither config.json nor log.csv, or if the page cannot be written.
void write_report(const std::vector<std::string>& runs, const std::string& path);

}  // namespace vsplat
