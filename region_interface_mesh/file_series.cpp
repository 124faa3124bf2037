#include "file_series.h"

#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <fstream>

#include "whole_file.h"

namespace solidcull {
namespace {

constexpr std::size_t least_digits = 9;
constexpr double same_time = 1e-9;  // share of it

/// What stands behind `key` in a line of the list, up to one of `ends`; empty if it is not there.
std::string value_in(const std::string& line, const std::string& key, const char* ends) {
  const std::size_t at = line.find(key);
  if (at == std::string::npos) return {};
  const std::size_t begin = at + key.size();
  return line.substr(begin, line.find_first_of(ends, begin) - begin);
}

}  // namespace

FileSeries::FileSeries(const std::string& pattern) {
  const std::size_t slash = pattern.rfind('/');
  folder_ = slash == std::string::npos ? "" : pattern.substr(0, slash + 1);
  const std::string name = pattern.substr(folder_.size());
  const std::size_t star = name.find('*');
  numbered_ = star != std::string::npos;
  before_ = name.substr(0, star);
  after_ = numbered_ ? name.substr(star + 1) : "";
}

std::string FileSeries::file(std::int64_t step) const {
  if (!numbered_) return folder_ + before_;
  std::string digits = std::to_string(step);
  if (digits.size() < least_digits) digits.insert(0, least_digits - digits.size(), '0');
  return folder_ + before_ + digits + after_;
}

std::string FileSeries::list() const {
  std::string name = before_;
  if (!name.empty() && std::string("._-").find(name.back()) != std::string::npos) name.pop_back();
  return folder_ + (name.empty() ? "frames" : name) + after_ + ".series";
}

/// Below 0: the name is none of this pattern.
std::int64_t FileSeries::step_of(const std::string& name) const {
  if (name.size() <= before_.size() + after_.size() || name.compare(0, before_.size(), before_) != 0 ||
      name.compare(name.size() - after_.size(), after_.size(), after_) != 0)
    return -1;
  const std::string digits = name.substr(before_.size(), name.size() - before_.size() - after_.size());
  if (digits.find_first_not_of("0123456789") != std::string::npos || digits.size() > 18) return -1;
  return std::strtoll(digits.c_str(), nullptr, 10);
}

/// What the list has of files that are there, in its order.
std::vector<FileSeries::Entry> FileSeries::earlier_than(std::int64_t step) const {
  std::vector<Entry> all;
  std::ifstream there(list());
  for (std::string line; std::getline(there, line);) {
    const std::string name = value_in(line, "\"name\": \"", "\""), time = value_in(line, "\"time\": ", "},");
    const std::int64_t of = step_of(name);
    if (of >= 0 && of < step && !time.empty() && ::access((folder_ + name).c_str(), F_OK) == 0)
      all.push_back({name, of, std::strtod(time.c_str(), nullptr)});
  }
  return all;
}

double FileSeries::time_of(std::int64_t step, double dt) const {
  const double since_0 = static_cast<double>(step) * dt;
  if (!numbered_) return since_0;
  const std::vector<Entry> all = earlier_than(step);
  if (all.empty()) return since_0;
  const Entry& last = *std::max_element(all.begin(), all.end(), [](const Entry& a, const Entry& b) { return a.step < b.step; });
  const double since_last = last.time + static_cast<double>(step - last.step) * dt;
  return std::abs(since_last - since_0) < same_time * since_0 ? since_0 : since_last;  // no rounding adds up
}

void FileSeries::note(std::int64_t step, double time) const {
  if (!numbered_) return;
  std::string files;
  const auto add = [&](const std::string& name, double at) {
    char told[32];
    std::snprintf(told, sizeof told, "%.17g", at);
    files += (files.empty() ? "    {\"name\": \"" : ",\n    {\"name\": \"") + name + "\", \"time\": " + told + "}";
  };
  for (const Entry& e : earlier_than(step)) add(e.name, e.time);
  add(file(step).substr(folder_.size()), time);
  WholeFile out(list());
  out.write("{\n  \"file-series-version\": \"1.0\",\n  \"files\": [\n" + files + "\n  ]\n}\n");
  out.commit();
}

}  // namespace solidcull
