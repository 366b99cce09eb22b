// Data sets: folders (or files) of objects, each with posed pictures. Listing opens no picture.
#pragma once
#include <filesystem>
#include <string>
#include <vector>

#include "model/views/input.h"

namespace vsplat {

enum class DataLayout {
  folder,  // a folder per object, anything that read_views() takes
  gso,     // the same in LaRa's layout of Google Scanned Objects
  hdf5     // LaRa's HDF5 files
};
const char* name_of(DataLayout layout);

struct DataObject {
  std::string name;
  DataLayout layout = DataLayout::folder;
  std::filesystem::path path;        // its folder, or its file
  std::string group = {};            // in that file
  std::filesystem::path given = {};  // the folder in which it was found, as named
};

// How errors call it: "object cup"; of a group, which is called as many others are, with its file.
std::string told(const DataObject& object);

struct DataSet {
  std::vector<DataObject> objects;  // in the order of the paths given, in each by name; no two names are equal
};

// Each path: an object's folder or its list of views, an HDF5 file, or a folder with either at most four levels down.
// Objects are called
// like their folders or groups; of those that are equal, the second is NAME_2. Error(file) where a path is not there,
// Error(input) where it holds no object; else as Hdf5File has them.
DataSet open_data_set(const std::vector<std::string>& paths);

// The views of an object, every one with a picture and all intrinsics. What is wrong with one (no picture, no mask, a
// size that does not fit, a pose that is none) is an Error(file, format or input) that names object, view and field; or
// where `skipped` is given, is added to it for each view that has to be left out, while any view is left.
// Where `missing` is given, views of a folder's list whose picture is not there are passed over instead, as
// reconstructing does, and told in it, all in one text; none left is an Error(input).
// Of sets with parts all are there, and ListedView::split tells them apart; `to_train_on`: those to train on alone.
Photographs open_object(const DataObject& object, std::vector<std::string>* skipped = nullptr,
                        std::vector<std::string>* missing = nullptr, bool to_train_on = false);

// Whether it says that data are bad, as against a defect or memory that is short.
bool is_about_data(const Error& error);

}  // namespace vsplat
