// VTK XML PolyData files (.vtp): a head in XML, and behind it the arrays it names, each compressed by zlib. ParaView and VTK read
// them, and any program that knows XML and zlib.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

namespace solidcull {

/// One piece of such a file. A file may have several, of one rank each, one behind the other. Local.
class PolyDataPiece {
 public:
  PolyDataPiece(std::size_t points, std::size_t verts, std::size_t polys);

  /// Opens a part of the piece, `<words>`; closed by the next one, or by the end. Arrays stand in parts.
  void begin(const std::string& words);
  /// An array of numbers, `components` to a point or cell. T: float, int, std::int64_t.
  template <class T>
  void add(const std::string& name, const std::vector<T>& values, int components = 1);
  /// The array added last once more, under another name: it costs no room in the file.
  void again(const std::string& name);
  /// Cells of `size` points each: which points, and where each cell ends.
  void add_cells(const std::string& kind, const std::vector<int>& connectivity, int size);

  /// What stands in the head for this piece, if its data begin so many bytes behind the mark of the appended data.
  std::string head(std::uint64_t data_begin) const;
  const std::string& data() const { return data_; }

 private:
  struct Array {
    std::string part;  ///< that begins here, if one does
    std::string words;
    std::uint64_t offset;
  };

  std::string counts_, open_, pending_;
  std::vector<Array> arrays_;
  std::string data_;
};

/// What stands before the heads of the pieces, between these and the data, and behind the data. time: s, said as VTK's TimeValue.
std::string poly_data_begins(double time);
extern const char *const poly_data_middle, *const poly_data_ends;

/// Bytes as VTK's vtkZLibDataCompressor has them: how many blocks, of what size, the size of the last one if it is shorter, what
/// each takes compressed; then the blocks.
std::string compressed_blocks(std::string_view bytes);

}  // namespace solidcull
