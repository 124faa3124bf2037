#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <sstream>
#include <stdexcept>

#include "file_series.h"
#include "temporary_folder.h"

namespace solidcull {
namespace {

namespace fs = std::filesystem;

class AFileSeries : public ::testing::Test {
 protected:
  std::string path(const std::string& name) const { return folder / name; }
  /// Writes the file of a step, as the fix does, and notes it.
  static void write(const FileSeries& series, std::int64_t step, double time) {
    std::ofstream(series.file(step)) << "x";
    series.note(step, time);
  }
  static std::string content(const std::string& file) {
    std::ifstream in(file);
    std::ostringstream all;
    all << in.rdbuf();
    return all.str();
  }

  TemporaryFolder folder;
};

TEST_F(AFileSeries, numbers_sort_as_steps_do) {
  const FileSeries series("out/bed.*.vtp");
  EXPECT_TRUE(series.numbered());
  EXPECT_EQ(series.file(0), "out/bed.000000000.vtp");
  EXPECT_EQ(series.file(400), "out/bed.000000400.vtp");
  EXPECT_EQ(series.file(123456789012), "out/bed.123456789012.vtp");
}

TEST_F(AFileSeries, one_file_has_its_own_name_and_no_list) {
  const FileSeries series(path("bed.vtp"));
  EXPECT_FALSE(series.numbered());
  write(series, 400, 0.1);
  EXPECT_TRUE(fs::exists(path("bed.vtp")));
  EXPECT_EQ(std::distance(fs::directory_iterator(folder.path()), {}), 1);
}

TEST_F(AFileSeries, the_list_is_named_as_its_files) {
  EXPECT_EQ(FileSeries("out/bed.*.vtp").list(), "out/bed.vtp.series");
  EXPECT_EQ(FileSeries("bed_*.vtp").list(), "bed.vtp.series");
  EXPECT_EQ(FileSeries("bed*.stl").list(), "bed.stl.series");
  EXPECT_EQ(FileSeries("a/*.vtp").list(), "a/frames.vtp.series");
}

TEST_F(AFileSeries, the_list_has_the_time_of_each_file) {
  const FileSeries series(path("bed.*.vtp"));
  write(series, 0, 0);
  write(series, 100, 0.1);
  EXPECT_EQ(content(path("bed.vtp.series")),
            "{\n  \"file-series-version\": \"1.0\",\n  \"files\": [\n"
            "    {\"name\": \"bed.000000000.vtp\", \"time\": 0},\n"
            "    {\"name\": \"bed.000000100.vtp\", \"time\": 0.10000000000000001}\n  ]\n}\n");
}

TEST_F(AFileSeries, a_run_that_goes_on_keeps_what_is_older_and_writes_over_the_rest) {
  for (const int step : {0, 100, 200, 300}) write(FileSeries(path("bed.*.vtp")), step, 1e-3 * step);
  fs::remove(path("bed.000000100.vtp"));
  write(FileSeries(path("bed.*.vtp")), 200, 0.5);  // read from a restart file of step 200, say
  const std::string list = content(path("bed.vtp.series"));
  EXPECT_NE(list.find("bed.000000000.vtp\", \"time\": 0}"), std::string::npos);
  EXPECT_EQ(list.find("bed.000000100.vtp"), std::string::npos) << "it is not there any more";
  EXPECT_NE(list.find("bed.000000200.vtp\", \"time\": 0.5}"), std::string::npos);
  EXPECT_EQ(list.find("bed.000000300.vtp"), std::string::npos) << "it is of a run that was given up";
}

TEST_F(AFileSeries, time_goes_on_from_the_newest_file_before) {
  const FileSeries series(path("bed.*.vtp"));
  EXPECT_EQ(series.time_of(1000, 1e-3), 1.0) << "from step 0, whatever went before";
  for (std::int64_t step = 0; step <= 3000; step += 100) write(series, step, series.time_of(step, 1e-3));
  EXPECT_EQ(series.time_of(3100, 1e-3), 3.1) << "no rounding adds up";
  EXPECT_DOUBLE_EQ(series.time_of(3100, 1e-4), 3.01) << "another time step";
  EXPECT_DOUBLE_EQ(series.time_of(1050, 1e-4), 1.005) << "a run that goes on from there";
  EXPECT_EQ(series.time_of(0, 1e-3), 0);
  EXPECT_EQ(FileSeries(path("one.vtp")).time_of(50, 1e-3), 0.05);
}

TEST_F(AFileSeries, what_is_no_list_is_no_trouble) {
  const FileSeries series(path("bed.*.vtp"));
  std::ofstream(series.list())
      << "no list\n    {\"name\": \"mesh.000000000.vtp\", \"time\": 0}\n\"name\": \"bed.x.vtp\"\n\"name\": ";
  write(series, 5, 1);
  EXPECT_EQ(content(series.list()),
            "{\n  \"file-series-version\": \"1.0\",\n  \"files\": [\n"
            "    {\"name\": \"bed.000000005.vtp\", \"time\": 1}\n  ]\n}\n");
}

TEST_F(AFileSeries, a_list_that_cannot_be_written_is_an_error_and_the_old_one_stays) {
  const FileSeries series(path("bed.*.vtp"));
  write(series, 0, 0);
  const std::string before = content(series.list());
  fs::create_symlink("/dev/full", series.list() + ".part");
  EXPECT_THROW(series.note(5, 1), std::runtime_error);
  EXPECT_EQ(content(series.list()), before);
}

}  // namespace
}  // namespace solidcull
