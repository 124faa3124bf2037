#include "section_delivery.h"

#include <algorithm>
#include <utility>

namespace solidcull {
namespace {

/// Interface granules of a restart file, whose bodies are still in it.
std::vector<std::int64_t> atoms_that_wait(const Bed& bed) {
  std::vector<std::int64_t> tags;
  for (int i = 0; i < bed.atoms.owned; ++i)
    if (bed.shell[i].locked && bed.shell[i].body == 0) tags.push_back(bed.atoms.tag[i]);
  return tags;
}

}  // namespace

SectionDelivery::SectionDelivery(Bed& bed, Parcels& parcels, SectionReader& section, bool same_walls)
    : bed_(bed),
      same_walls_(same_walls),
      parcels_(parcels),
      section_(section),
      atoms_(bed.ranks, atoms_that_wait(bed)),
      shares_(bed) {}

SectionCounts SectionDelivery::take_all() {
  parcels_.begin_taking();
  const std::vector<SectionReader::Dealt> dealt = section_.dealt();
  section_.agree();
  for (std::size_t k = 0; bed_.ranks.any(k < dealt.size()); ++k) {
    has_granules_ = false;
    if (k < dealt.size()) read(dealt[k]);
    section_.agree();
    exchange_shares();
  }
  exchange_contacts();
  parcels_.end_taking();
  return read_;
}

void SectionDelivery::read(const SectionReader::Dealt& next) {
  SectionChunk chunk;
  if (part_ != next.part) {
    if (!section_.read(next.of_part, chunk)) return;
    shares_.begin(chunk);
    part_ = next.part;
  }
  read_.add(next.place.kind, next.place.granules);
  if (next.place.kind == SectionChunk::part || !section_.read(next.place, chunk)) return;
  shares_.open(chunk);
  has_granules_ = true;
}

void SectionDelivery::exchange_shares() {
  const std::vector<int> atoms_on = atoms_.of(has_granules_ ? shares_.interface_tags() : std::vector<std::int64_t>());
  std::map<int, ChunkShare> shares;
  if (has_granules_) shares = shares_.shares(atoms_on);
  std::map<int, std::vector<char>> messages;
  for (const auto& [rank, share] : shares)
    if (rank != bed_.ranks.me) messages[rank] = packed(share, part_);
  const std::map<int, std::vector<char>> came = bed_.ranks.deliver(messages);
  messages.clear();
  const auto own = shares.find(bed_.ranks.me);
  if (own != shares.end()) take(bed_.ranks.me, own->second, part_);
  for (const auto& [rank, message] : came) {
    ChunkShare share;
    const std::uint64_t part = unpack(message, share);
    take(rank, share, part);
  }
}

void SectionDelivery::take(int from, const ChunkShare& share, std::uint64_t part) {
  ChunkReader& reader = readers_.try_emplace(from, bed_, same_walls_).first->second;
  if (share.begins)
    reader.part(share.part, part);
  else
    reader.more_bodies(share.part.bodies);
  Parcel parcel = reader.parcel(share.granules);
  parcel.for_this_rank = true;
  parcels_.take(&parcel, 1);
}

/// All granules have their ranks. A contact with a granule of another rank goes there too, whether it is known there or not; one
/// that stood with neither of its granules goes to both.
void SectionDelivery::exchange_contacts() {
  const std::size_t width = bed_.solid.contacts().width();
  std::vector<Loose> known_here;
  bed_.solid.contacts().for_each_contact_in_world([&](std::int64_t low, std::int64_t high, const double* history) {
    const SolidBodies& bodies = bed_.solid.bodies();
    if (bodies.body_of(low) && bodies.body_of(high)) return;
    Loose contact{static_cast<double>(low), static_cast<double>(high), static_cast<double>(history != nullptr)};
    contact.resize(3 + width);
    if (history) std::copy(history, history + width, contact.begin() + 3);
    known_here.push_back(std::move(contact));
  });
  const std::vector<Loose>& known_nowhere = shares_.without_granules();
  if (!bed_.ranks.any(!known_here.empty() || !known_nowhere.empty())) return;

  std::vector<std::int64_t> here, asked;
  for (int i = 0; i < bed_.atoms.owned; ++i)
    if (bed_.shell[i].locked) here.push_back(bed_.atoms.tag[i]);
  bed_.solid.store().for_each([&](const Resident& g) { here.push_back(g.tag); });
  const TagOwners granules(bed_.ranks, here);
  const auto tag = [](double x) { return static_cast<std::int64_t>(x); };
  for (const Loose& c : known_here) asked.push_back(tag(bed_.solid.bodies().body_of(tag(c[0])) ? c[1] : c[0]));
  for (const Loose& c : known_nowhere) asked.insert(asked.end(), {tag(c[0]), tag(c[1])});
  const std::vector<int> owners = granules.of(asked);

  std::map<int, std::vector<double>> letters;
  auto owner = owners.begin();
  const auto send = [&](const Loose& c) {
    if (*owner != TagOwners::nobody) letters[*owner].insert(letters[*owner].end(), c.begin(), c.end());
    ++owner;
  };
  for (const Loose& c : known_here) send(c);
  for (const Loose& c : known_nowhere) {
    send(c);
    send(c);
  }
  for (const auto& [rank, numbers] : bed_.ranks.deliver(letters))
    for (std::size_t at = 0; at < numbers.size(); at += 3 + width)
      parcels_.take_contact(tag(numbers[at]), tag(numbers[at + 1]), numbers[at + 2] != 0 ? &numbers[at + 3] : nullptr);
}

}  // namespace solidcull
