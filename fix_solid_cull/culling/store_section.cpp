#include "store_section.h"

#include <algorithm>
#include <cerrno>
#include <cstring>

#include "input_error.h"

namespace solidcull {
namespace {

constexpr std::uint64_t begins = 0x31424c4c55434453, ends = 0x31454c4c55434453;  // "SDCULLB1", "SDCULLE1"
constexpr std::size_t word_bytes = sizeof(std::uint64_t);
constexpr int beginning_words = 2, head_words = 5, end_words = 9;
constexpr std::size_t row_words = 4;  // of lists and of the table of parts
constexpr std::uint64_t largest_chunk = std::uint64_t{1} << 31;
static_assert(sizeof(ChunkPlace) == row_words * word_bytes && sizeof(SectionReader::Part) == row_words * word_bytes,
              "rows are words");

std::uint64_t sum_of_words(const std::uint64_t* words, std::size_t n) {
  return section_sum(reinterpret_cast<const char*>(words), n * word_bytes);
}

}  // namespace

std::uint64_t section_sum(const char* bytes, std::size_t n) {
  std::uint64_t sum = 0;
  for (std::size_t k = 0; k < n / word_bytes; ++k) {
    std::uint64_t w;
    std::memcpy(&w, bytes + k * word_bytes, word_bytes);
    w += (k + 1) * 0x9e3779b97f4a7c15u;
    w = (w ^ (w >> 32)) * 0xd6e8feb86659fd93u;
    sum += w ^ (w >> 29);
  }
  return sum;
}

void SectionChunk::pack(std::vector<char>& to) const {
  const std::size_t size = (bytes.size() + word_bytes - 1) / word_bytes * word_bytes, at = to.size();
  to.resize(at + head_words * word_bytes + size);
  char* const body = &to[at] + head_words * word_bytes;
  std::copy(bytes.begin(), bytes.end(), body);
  std::uint64_t head[head_words] = {kind, rank, granules, size, 0};
  head[head_words - 1] = section_sum(body, size) + sum_of_words(head, head_words - 1);
  std::memcpy(&to[at], head, sizeof head);
}

const char* SectionChunk::unpack(const char* at, const char* end) {
  std::uint64_t head[head_words];
  const std::size_t there = static_cast<std::size_t>(end - at);
  if (there < sizeof head) return nullptr;
  std::memcpy(head, at, sizeof head);
  const std::uint64_t size = head[3];
  if (size % word_bytes != 0 || size > there - sizeof head) return nullptr;
  at += sizeof head;
  if (head[head_words - 1] != section_sum(at, size) + sum_of_words(head, head_words - 1)) return nullptr;
  begin(head[0], head[1], head[2]);
  bytes.assign(at, at + size);
  return at + size;
}

// ------------------------------------------------------------------------------------------------------------ out

SectionWriter::SectionWriter(const Ranks& ranks, const std::string& file, std::uint64_t identity)
    : ranks_(ranks), file_(ranks.open_to_write(file)), identity_(identity) {
  const std::uint64_t beginning[beginning_words] = {begins, identity};
  if (ranks_.me == 0) file_->write(file_->size(), beginning, sizeof beginning);
  written_ = sizeof beginning;
}

/// Behind what is there, ranks in their order; returns where this rank's stand.
std::uint64_t SectionWriter::write_in_turn(const std::vector<char>& bytes) {
  std::int64_t all = static_cast<std::int64_t>(bytes.size());
  const std::uint64_t at = written_ + static_cast<std::uint64_t>(ranks_.sum_before(all));
  ranks_.sum(&all, 1);
  written_ += static_cast<std::uint64_t>(all);
  if (!bytes.empty()) file_->write(file_->size() + at, bytes.data(), bytes.size());
  return at;
}

bool SectionWriter::put(const SectionChunk& chunk) {
  std::vector<char> bytes;
  if (!chunk.bytes.empty()) chunk.pack(bytes);
  const std::uint64_t before = written_, at = write_in_turn(bytes);
  if (!bytes.empty()) chunks_.push_back({at, bytes.size(), chunk.kind, chunk.granules});
  return written_ != before;
}

void SectionWriter::close(const SectionCounts& counts) {
  SectionReader::Part part{0, chunks_.size(), 0, 0};
  std::vector<char> list(chunks_.size() * sizeof(ChunkPlace) + word_bytes);
  if (!chunks_.empty()) std::memcpy(list.data(), chunks_.data(), list.size() - word_bytes);
  const std::uint64_t sum = section_sum(list.data(), list.size() - word_bytes);
  std::memcpy(&list[list.size() - word_bytes], &sum, word_bytes);
  for (const ChunkPlace& c : chunks_) {
    part.bytes += c.size;
    part.granules += c.granules;
  }
  part.list = write_in_turn(list);
  std::int64_t all[] = {static_cast<std::int64_t>(chunks_.size()), static_cast<std::int64_t>(counts.interior),
                        static_cast<std::int64_t>(counts.interface_granules), static_cast<std::int64_t>(counts.contacts)};
  ranks_.sum(all, 4);
  const std::vector<SectionReader::Part> parts = ranks_.gather_on_root(std::vector<SectionReader::Part>{part});
  if (ranks_.me == 0) {
    std::vector<std::uint64_t> words(parts.size() * row_words);
    std::memcpy(words.data(), parts.data(), words.size() * word_bytes);
    words.insert(words.end(), {ends, identity_, written_ + (words.size() + end_words) * word_bytes, parts.size()});
    for (const std::int64_t n : all) words.push_back(static_cast<std::uint64_t>(n));
    words.push_back(sum_of_words(words.data(), words.size()));
    file_->write(file_->size() + written_, words.data(), words.size() * word_bytes);
  }
  std::int64_t error = file_->close();
  ranks_.largest(&error, 1);
  if (error)
    throw InputError("the restart file could not be written (" + std::string(std::strerror(static_cast<int>(error))) +
                     "): make room, or write it elsewhere");
}

// ------------------------------------------------------------------------------------------------------------ in

SectionReader::SectionReader(const Ranks& ranks, const std::string& file, std::uint64_t identity) : ranks_(ranks) {
  const std::vector<char> name = ranks.gather(ranks.me == 0 ? std::vector<char>(file.begin(), file.end()) : std::vector<char>());
  name_.assign(name.begin(), name.end());
  std::vector<std::uint64_t> words;
  if (ranks.me == 0) wrong_ = open(identity, words);
  agree();
  words = ranks.gather(words);  // where the section begins, where chunks end, counts, the table of parts
  begin_ = words[0];
  end_of_chunks_ = words[1];
  counts_ = {words[2], words[3], words[4], words[5]};
  parts_.resize((words.size() - 6) / row_words);
  if (!parts_.empty()) std::memcpy(parts_.data(), &words[6], parts_.size() * sizeof(Part));
  if (ranks.me != 0) {
    file_ = std::fopen(name_.c_str(), "rb");
    if (!file_)
      wrong_ = "the restart file " + name_ + " cannot be opened by all ranks (" + std::strerror(errno) +
               "): put it where each of them sees it";
    else
      std::setvbuf(file_, nullptr, _IONBF, 0);
  }
  agree();
}

SectionReader::~SectionReader() {
  if (file_) std::fclose(file_);
}

/// By rank 0. What is wrong with the file; empty if nothing is.
std::string SectionReader::open(std::uint64_t identity, std::vector<std::uint64_t>& words) {
  if (name_.empty()) return "the file that read_restart read is not known: read it with the command read_restart";
  const std::string file = "the restart file " + name_;
  file_ = std::fopen(name_.c_str(), "rb");
  if (!file_) return file + " cannot be opened again (" + std::strerror(errno) + "): it holds the granules of this fix";
  std::setvbuf(file_, nullptr, _IONBF, 0);  // what is asked for is read, no more
  const std::string cut =
      file + " ends before the granules of this fix do: it was cut when it was written or copied; use a whole one";
  std::uint64_t end[end_words];
  if (fseeko(file_, 0, SEEK_END) != 0) return cut;
  const std::uint64_t size = static_cast<std::uint64_t>(ftello(file_));
  if (size < sizeof end || !fetch(size - sizeof end, end, sizeof end) || end[0] != ends) return cut;
  const std::uint64_t least = (beginning_words + end_words) * word_bytes;
  const std::uint64_t section = end[2], parts = end[3];
  const std::string damaged = file + " is damaged at its end: use another one";
  if (section > size || section < least || parts > (section - least) / (row_words * word_bytes)) return damaged;
  std::vector<std::uint64_t> table(parts * row_words);
  const std::uint64_t table_at = size - sizeof end - table.size() * word_bytes;
  const bool read = fetch(table_at, table.data(), table.size() * word_bytes);
  table.insert(table.end(), end, end + end_words - 1);
  if (!read || sum_of_words(table.data(), table.size()) != end[end_words - 1]) return damaged;
  std::uint64_t beginning[beginning_words];
  begin_ = size - section;
  if (!fetch(begin_, beginning, sizeof beginning) || beginning[0] != begins || beginning[1] != end[1])
    return file + " is damaged where the granules of this fix begin: use another one";
  if (end[1] != identity) return file + " holds the granules of another restart file: use a file as it was written";
  words = {begin_, table_at - begin_, end[4], end[5], end[6], end[7]};
  words.insert(words.end(), table.begin(), table.end() - (end_words - 1));
  return "";
}

/// What one rank found is found by all; of several the first says it.
void SectionReader::agree() {
  if (!ranks_.any(!wrong_.empty())) return;
  std::int64_t first = wrong_.empty() ? -ranks_.count : -ranks_.me;
  ranks_.largest(&first, 1);
  std::vector<char> text;
  if (-first == ranks_.me) text.assign(wrong_.begin(), wrong_.end());
  text = ranks_.gather(text);
  throw InputError(std::string(text.begin(), text.end()));
}

bool SectionReader::fetch(std::uint64_t at, void* to, std::size_t n) {
  return fseeko(file_, static_cast<off_t>(at), SEEK_SET) == 0 && (n == 0 || std::fread(to, n, 1, file_) == 1);
}

std::vector<ChunkPlace> SectionReader::list(std::size_t part) {
  const Part& p = parts_[part];
  std::vector<ChunkPlace> list;
  std::uint64_t sum = 0, bytes = 0, granules = 0;
  bool whole = p.list < end_of_chunks_ && end_of_chunks_ - p.list >= word_bytes &&
               p.chunks <= (end_of_chunks_ - p.list - word_bytes) / sizeof(ChunkPlace);
  if (whole) {
    list.resize(p.chunks);
    whole = fetch(begin_ + p.list, list.data(), list.size() * sizeof(ChunkPlace)) &&
            fetch(begin_ + p.list + list.size() * sizeof(ChunkPlace), &sum, word_bytes) &&
            sum == section_sum(reinterpret_cast<const char*>(list.data()), list.size() * sizeof(ChunkPlace));
  }
  for (const ChunkPlace& c : list) {
    whole = whole && c.size >= head_words * word_bytes && c.size <= largest_chunk && c.at <= end_of_chunks_ &&
            c.size <= end_of_chunks_ - c.at;
    bytes += c.size;
    granules += c.granules;
  }
  if (whole && !list.empty() && list[0].kind == SectionChunk::part && bytes == p.bytes && granules == p.granules) return list;
  wrong_ = "the restart file " + name_ + " is damaged among the granules of this fix: use another one";
  return {};
}

bool SectionReader::read(const ChunkPlace& place, SectionChunk& chunk) {
  const auto kept = kept_.find(place.at);
  if (kept != kept_.end()) {
    chunk = std::move(kept->second);
    kept_.erase(kept);
    return true;
  }
  std::vector<char> bytes(place.size);
  if (fetch(begin_ + place.at, bytes.data(), bytes.size()) &&
      chunk.unpack(bytes.data(), bytes.data() + bytes.size()) == bytes.data() + bytes.size() && chunk.kind == place.kind &&
      chunk.granules == place.granules)
    return true;
  wrong_ = "the restart file " + name_ + " is damaged among the granules of this fix: use another one";
  chunk.bytes.clear();
  return false;
}

/// Parts one after the other, chunks in their order: whoever's share holds the first byte of a chunk has it.
auto SectionReader::dealt() -> std::vector<Dealt> {
  std::uint64_t all = 0;
  for (const Part& p : parts_) all += p.bytes;
  const auto share_begins = [&](int rank) {
    const std::uint64_t ranks = static_cast<std::uint64_t>(ranks_.count), r = static_cast<std::uint64_t>(rank);
    return all / ranks * r + all % ranks * r / ranks;
  };
  const std::uint64_t begin = share_begins(ranks_.me), end = share_begins(ranks_.me + 1);
  std::vector<Dealt> mine;
  std::uint64_t at = 0;
  for (std::size_t p = 0; p < parts_.size() && at < end; at += parts_[p++].bytes) {
    if (at + parts_[p].bytes <= begin) continue;
    const std::vector<ChunkPlace> chunks = list(p);
    std::uint64_t from = at;
    for (const ChunkPlace& c : chunks) {
      if (from >= begin && from < end) mine.push_back({p, c, chunks.front()});
      from += c.size;
    }
  }
  return mine;
}

}  // namespace solidcull
