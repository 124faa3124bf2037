#include "store_section.h"

#include <cerrno>
#include <cstring>

#include "input_error.h"

namespace solidcull {
namespace {

constexpr std::uint64_t begins = 0x31424c4c55434453, ends = 0x31454c4c55434453;  // "SDCULLB1", "SDCULLE1"
constexpr std::size_t word = sizeof(std::uint64_t);
constexpr int beginning_words = 2, head_words = 5, end_words = 8;
constexpr std::uint64_t largest_chunk = std::uint64_t{1} << 31;

}  // namespace

std::uint64_t section_sum(const char* bytes, std::size_t n) {
  std::uint64_t sum = 0;
  for (std::size_t k = 0; k < n / word; ++k) {
    std::uint64_t w;
    std::memcpy(&w, bytes + k * word, word);
    w += (k + 1) * 0x9e3779b97f4a7c15u;
    w = (w ^ (w >> 32)) * 0xd6e8feb86659fd93u;
    sum += w ^ (w >> 29);
  }
  return sum;
}

// ------------------------------------------------------------------------------------------------------------ out

SectionWriter::SectionWriter(const Ranks& ranks, const std::string& file, std::uint64_t identity)
    : ranks_(ranks), identity_(identity) {
  if (ranks_.me != 0) return;
  file_ = std::fopen(file.c_str(), "ab");
  if (!file_) error_ = errno;
  const std::uint64_t beginning[beginning_words] = {begins, identity};
  write(beginning, sizeof beginning);
}

SectionWriter::~SectionWriter() {
  if (file_) std::fclose(file_);
}

void SectionWriter::write(const void* from, std::size_t n) {
  bytes_ += n;
  if (error_ == 0 && n > 0 && std::fwrite(from, 1, n, file_) != n) error_ = errno ? errno : EIO;
}

void SectionWriter::put(const SectionChunk& chunk) {
  std::vector<char> mine;
  const bool gives = !chunk.bytes.empty();
  if (gives) {
    const std::size_t size = (chunk.bytes.size() + word - 1) / word * word;
    mine.resize(head_words * word + size);
    std::memcpy(mine.data() + head_words * word, chunk.bytes.data(), chunk.bytes.size());
    std::uint64_t head[head_words] = {chunk.kind, chunk.rank, chunk.granules, size, 0};
    head[head_words - 1] =
        section_sum(mine.data() + head_words * word, size) + section_sum(reinterpret_cast<const char*>(head), 4 * word);
    std::memcpy(mine.data(), head, sizeof head);
  }
  if (ranks_.count > 1) mine = ranks_.gather_on_root(mine);
  if (ranks_.me != 0) return;
  write(mine.data(), mine.size());
  ++chunks_;
}

void SectionWriter::close(const SectionCounts& counts) {
  if (ranks_.me == 0) {
    std::uint64_t end[end_words] = {
        ends, identity_, bytes_ + end_words * word, chunks_, counts.interior, counts.interface_granules, counts.contacts, 0};
    end[end_words - 1] = section_sum(reinterpret_cast<const char*>(end), (end_words - 1) * word);
    write(end, sizeof end);
    if (file_ && std::fclose(file_) != 0 && error_ == 0) error_ = errno;
    file_ = nullptr;
  }
  std::int64_t error = error_;
  ranks_.largest(&error, 1);
  if (error)
    throw InputError("the restart file could not be written (" + std::string(std::strerror(static_cast<int>(error))) +
                     "): make room, or write it elsewhere");
}

// ------------------------------------------------------------------------------------------------------------ in

/// What rank 0 found is found by all.
void SectionReader::agree(const std::string& wrong) {
  if (!ranks_.any(!wrong.empty())) return;
  const std::vector<char> text = ranks_.gather(std::vector<char>(wrong.begin(), wrong.end()));
  throw InputError(std::string(text.begin(), text.end()));
}

SectionReader::SectionReader(const Ranks& ranks, const std::string& file, std::uint64_t identity) : ranks_(ranks), name_(file) {
  std::string wrong;
  std::vector<SectionCounts> counts;
  const auto open = [&] {
    if (file.empty()) return std::string("the file that read_restart read is not known: read it with the command read_restart");
    file_ = std::fopen(file.c_str(), "rb");
    if (!file_)
      return "the restart file " + file + " cannot be opened again (" + std::strerror(errno) +
             "): it holds the granules of this fix";
    const std::string cut = "the restart file " + file +
                            " ends before the granules of this fix do: it was cut when it was written or copied; use a whole one";
    std::uint64_t end[end_words];
    if (fseeko(file_, -static_cast<off_t>(sizeof end), SEEK_END) != 0 || std::fread(end, sizeof end, 1, file_) != 1) return cut;
    const off_t size = ftello(file_);
    if (end[0] != ends) return cut;
    if (end[end_words - 1] != section_sum(reinterpret_cast<const char*>(end), (end_words - 1) * word) ||
        end[2] > static_cast<std::uint64_t>(size) || end[2] < (beginning_words + end_words) * word)
      return "the restart file " + file + " is damaged at its end: use another one";
    std::uint64_t beginning[beginning_words];
    if (fseeko(file_, size - static_cast<off_t>(end[2]), SEEK_SET) != 0 ||
        std::fread(beginning, sizeof beginning, 1, file_) != 1 || beginning[0] != begins || beginning[1] != end[1])
      return "the restart file " + file + " is damaged where the granules of this fix begin: use another one";
    if (end[1] != identity)
      return "the restart file " + file + " holds the granules of another restart file: use a file as it was written";
    left_ = end[2] - (beginning_words + end_words) * word;
    counts = {{end[3], end[4], end[5], end[6]}};
    return std::string();
  };
  if (ranks_.me == 0) wrong = open();
  agree(wrong);
  counts_ = ranks_.gather(counts).front();
}

SectionReader::~SectionReader() {
  if (file_) std::fclose(file_);
}

bool SectionReader::head(SectionChunk& chunk) {
  std::vector<std::uint64_t> words;
  std::string wrong;
  if (ranks_.me == 0 && left_ > 0) {
    words.resize(head_words);
    if (left_ < head_words * word || std::fread(words.data(), word, head_words, file_) != head_words ||
        words[3] > left_ - head_words * word || words[3] % word != 0 || words[3] > largest_chunk)
      wrong = "the restart file " + name_ + " is damaged among the granules of this fix: use another one";
    else
      left_ -= head_words * word + words[3];
  }
  agree(wrong);
  words = ranks_.gather(words);
  if (words.empty()) return false;
  std::copy(words.begin(), words.begin() + 4, head_);
  size_ = words[3];
  sum_ = words[4];
  chunk.begin(words[0], words[1], words[2]);
  return true;
}

void SectionReader::body(SectionChunk& chunk, bool wanted) {
  std::string wrong;
  if (ranks_.me == 0) {
    if (!wanted) {
      if (fseeko(file_, static_cast<off_t>(size_), SEEK_CUR) != 0) wrong = "the restart file " + name_ + " cannot be read";
    } else {
      chunk.bytes.resize(size_);
      const bool read = std::fread(chunk.bytes.data(), 1, size_, file_) == size_;
      const std::uint64_t sum =
          section_sum(chunk.bytes.data(), size_) + section_sum(reinterpret_cast<const char*>(head_), sizeof head_);
      if (!read || sum != sum_)
        wrong = "the restart file " + name_ + " is damaged among the granules of this fix: use another one";
    }
  }
  agree(wrong);
  if (wanted && ranks_.count > 1) chunk.bytes = ranks_.gather(chunk.bytes);
}

}  // namespace solidcull
