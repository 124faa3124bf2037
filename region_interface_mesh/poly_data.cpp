#include "poly_data.h"

#include <zlib.h>

#include <cstdio>
#include <stdexcept>

namespace solidcull {
namespace {

// places of granules hardly shrink at any level, all else shrinks at the first
constexpr int zlib_level = 1;
constexpr std::size_t block_size = 1 << 18;  // bytes

static_assert(sizeof(float) == 4 && sizeof(int) == 4, "the files hold 32-bit numbers");

template <class T>
constexpr const char* vtk_type();
template <>
constexpr const char* vtk_type<float>() {
  return "Float32";
}
template <>
constexpr const char* vtk_type<int>() {
  return "Int32";
}
template <>
constexpr const char* vtk_type<std::int64_t>() {
  return "Int64";
}

void append(std::string& to, std::uint64_t number) { to.append(reinterpret_cast<const char*>(&number), sizeof number); }

/// The word that a part begins with.
std::string name_of(const std::string& words) { return words.substr(0, words.find(' ')); }

}  // namespace

const char* const poly_data_middle = "  </PolyData>\n  <AppendedData encoding=\"raw\">\n   _";
const char* const poly_data_ends = "\n  </AppendedData>\n</VTKFile>\n";

std::string poly_data_begins(double time) {
  char told[32];
  std::snprintf(told, sizeof told, "%.17g", time);
  return "<?xml version=\"1.0\"?>\n"
         "<VTKFile type=\"PolyData\" version=\"1.0\" byte_order=\"LittleEndian\" header_type=\"UInt64\" "
         "compressor=\"vtkZLibDataCompressor\">\n"
         "  <PolyData>\n"
         "    <FieldData>\n"
         "      <DataArray type=\"Float64\" Name=\"TimeValue\" NumberOfTuples=\"1\" format=\"ascii\">" +
         std::string(told) +
         "</DataArray>\n"
         "    </FieldData>\n";
}

std::string compressed_blocks(std::string_view bytes) {
  const std::size_t blocks = (bytes.size() + block_size - 1) / block_size;
  std::string head, data, block(compressBound(block_size), '\0');
  append(head, blocks);
  append(head, block_size);
  append(head, bytes.size() % block_size);
  for (std::size_t b = 0; b < blocks; ++b) {
    const std::string_view from = bytes.substr(b * block_size, block_size);
    uLongf size = block.size();
    if (compress2(reinterpret_cast<Bytef*>(block.data()), &size, reinterpret_cast<const Bytef*>(from.data()), from.size(),
                  zlib_level) != Z_OK)
      throw std::runtime_error("zlib has no memory to compress " + std::to_string(from.size()) + " bytes");
    append(head, size);
    data.append(block, 0, size);
  }
  return head + data;
}

PolyDataPiece::PolyDataPiece(std::size_t points, std::size_t verts, std::size_t polys)
    : counts_("NumberOfPoints=\"" + std::to_string(points) + "\" NumberOfVerts=\"" + std::to_string(verts) +
              "\" NumberOfLines=\"0\" NumberOfStrips=\"0\" NumberOfPolys=\"" + std::to_string(polys) + "\"") {}

void PolyDataPiece::begin(const std::string& words) {
  pending_ += open_.empty() ? "" : "      </" + open_ + ">\n";
  pending_ += "      <" + words + ">\n";
  open_ = name_of(words);
}

template <class T>
void PolyDataPiece::add(const std::string& name, const std::vector<T>& values, int components) {
  arrays_.push_back({std::move(pending_),
                     std::string("type=\"") + vtk_type<T>() + "\" Name=\"" + name + "\" NumberOfComponents=\"" +
                         std::to_string(components) + '"',
                     data_.size()});
  pending_.clear();
  data_ += compressed_blocks({reinterpret_cast<const char*>(values.data()), values.size() * sizeof(T)});
}
template void PolyDataPiece::add(const std::string&, const std::vector<float>&, int);
template void PolyDataPiece::add(const std::string&, const std::vector<int>&, int);
template void PolyDataPiece::add(const std::string&, const std::vector<std::int64_t>&, int);

void PolyDataPiece::again(const std::string& name) {
  Array other = arrays_.back();
  other.part.clear();
  const std::size_t at = other.words.find("Name=\"") + 6;
  other.words.replace(at, other.words.find('"', at) - at, name);
  arrays_.push_back(other);
}

void PolyDataPiece::add_cells(const std::string& kind, const std::vector<int>& connectivity, int size) {
  std::vector<int> ends(connectivity.size() / static_cast<std::size_t>(size));
  for (std::size_t n = 0; n < ends.size(); ++n) ends[n] = static_cast<int>(n + 1) * size;
  begin(kind);
  add("connectivity", connectivity);
  add("offsets", ends);
}

std::string PolyDataPiece::head(std::uint64_t data_begin) const {
  std::string text = "    <Piece " + counts_ + ">\n";
  for (const Array& a : arrays_)
    text += a.part + "        <DataArray " + a.words + " format=\"appended\" offset=\"" + std::to_string(data_begin + a.offset) +
            "\"/>\n";
  return text + pending_ + (open_.empty() ? "" : "      </" + open_ + ">\n") + "    </Piece>\n";
}

}  // namespace solidcull
