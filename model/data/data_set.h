// Data sets: folders (or files) of objects, each with posed pictures. Listing a data set opens no picture.
#pragma once
#include <filesystem>
#include <string>
#include <vector>

#include "model/views/input.h"

namespace vsplat {

enum class DataLayout {
  folder,  // a folder per object, in any format of read_views()
  gso,     // as `folder`, in LaRa's layout of Google Scanned Objects
  hdf5     // LaRa's HDF5 files
};
const char* name_of(DataLayout layout);

struct DataObject {
  std::string name;
  DataLayout layout = DataLayout::folder;
  std::filesystem::path path;        // the object's folder or file
  std::string group = {};            // within that file
  std::filesystem::path given = {};  // the folder, as the user named it, in which the object was found
};

// The object's name in errors: "object cup". For a group it includes the file, because group names repeat between
// files.
std::string label_of(const DataObject& object);

struct DataSet {
  std::vector<DataObject> objects;  // in the order of the given paths, sorted by name within each; names are unique
};

// Each path is an object's folder or its list of views, an HDF5 file, or a folder that contains these at most four
// levels down. Objects are named like their folders or groups; the second of equal names becomes NAME_2. Error(file) if
// a path does not exist, Error(input) if it contains no object; other errors as Hdf5File.
DataSet open_data_set(const std::vector<std::string>& paths);

// The views of an object, each with a picture and all intrinsics. A problem with a view (no picture, no mask, a size
// that does not fit, an invalid pose) is an Error(file, format or input) that names object, view and field. With
// `skipped`, a problem is added there instead and the view is omitted, as long as any view is left.
// With `missing`, listed views of a folder whose picture does not exist are skipped instead, as in reconstruction, and
// reported there in a single text; if none is left, that is an Error(input).
// If a set has parts, views of all parts are returned with their ListedView::split; with `to_train_on`, only those for
// training.
Photographs open_object(const DataObject& object, std::vector<std::string>* skipped = nullptr,
                        std::vector<std::string>* missing = nullptr, bool to_train_on = false);

// Whether the error is about bad data, and not about a defect or a lack of memory.
bool is_about_data(const Error& error);

}  // namespace vsplat
