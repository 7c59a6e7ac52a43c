#include "library_fetch.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <fstream>

#include "scratch_folder.h"
#include "test_library.h"

namespace stridewire::client {
namespace {

namespace fs = std::filesystem;

bool Always(const std::string&) { return true; }

protocol::LibraryPiece PieceOf(const MotionLibrary& library,
                               const protocol::FetchLibrary& question) {
  const auto bytes = library.bytes().subspan(question.offset);
  const auto part = bytes.first(std::min<std::size_t>(bytes.size(), question.length));
  return {.nonce = question.nonce,
          .hash = question.hash,
          .total_bytes = library.bytes().size(),
          .offset = question.offset,
          .bytes = {part.begin(), part.end()}};
}

// Runs all tasks and answers all requests with the library of `server`. Returns the number of
// requests.
int Bring(LibraryFetch& fetch, const MotionLibrary& server) {
  int questions = 0;
  for (;;) {
    if (const auto task = fetch.TakeTask()) {
      fetch.OnTask(task->hash, RunLibraryTask(*task));
    } else if (const auto question = fetch.TakeRequest(Always)) {
      EXPECT_FALSE(fetch.TakeRequest(Always));  // only one pending request
      ++questions;
      fetch.OnPiece(PieceOf(server, *question));
    } else {
      return questions;
    }
  }
}

TEST(LibraryFetch, FetchesOnceAndThenReadsTheFolder) {
  const auto library = MakeTestLibrary();
  const test::ScratchFolder scratch;
  const std::string folder = scratch.File("new/folder");
  const auto whole = static_cast<int>((library->bytes().size() + LibraryFetch::kPieceBytes - 1) /
                                      LibraryFetch::kPieceBytes);
  LibraryFetch first(folder);
  ASSERT_EQ(first.Get(library->hash()).value(), nullptr);
  EXPECT_EQ(Bring(first, *library), whole);
  ASSERT_NE(first.Get(library->hash()).value(), nullptr);
  EXPECT_EQ(first.Get(library->hash()).value()->hash(), library->hash());
  const fs::path kept = fs::path(folder) / (library->hash() + ".swl");
  EXPECT_EQ(fs::file_size(kept), library->bytes().size());
  EXPECT_EQ(std::distance(fs::directory_iterator(folder), fs::directory_iterator()), 1);

  LibraryFetch second(folder);
  (void)second.Get(library->hash());
  EXPECT_EQ(Bring(second, *library), 0);
  EXPECT_NE(second.Get(library->hash()).value(), nullptr);

  // A damaged file is fetched again and replaced.
  std::ofstream(kept, std::ios::binary | std::ios::in).seekp(100).write("x", 1);
  LibraryFetch third(folder);
  (void)third.Get(library->hash());
  EXPECT_EQ(Bring(third, *library), whole);
  EXPECT_NE(third.Get(library->hash()).value(), nullptr);
  EXPECT_EQ(MotionLibrary::Open(kept).value()->hash(), library->hash());
}

TEST(LibraryFetch, WorksWithoutAFolder) {
  const auto library = MakeTestLibrary();
  for (const char* folder : {"", "/dev/null/not a folder"}) {
    LibraryFetch fetch(folder);
    (void)fetch.Get(library->hash());
    EXPECT_GT(Bring(fetch, *library), 0);
    EXPECT_NE(fetch.Get(library->hash()).value(), nullptr);
  }
}

TEST(LibraryFetch, ContinuesAfterAConnectionLoss) {
  const auto library = MakeTestLibrary();
  LibraryFetch fetch("");
  (void)fetch.Get(library->hash());
  fetch.OnTask(library->hash(), RunLibraryTask(*fetch.TakeTask()));
  const auto asked = fetch.TakeRequest(Always);
  ASSERT_TRUE(asked);
  fetch.OnConnectionLost();
  EXPECT_FALSE(fetch.TakeRequest([](const std::string&) { return false; }));
  const auto again = fetch.TakeRequest(Always);
  ASSERT_TRUE(again);
  fetch.OnPiece(PieceOf(*library, *asked));  // ignored: answers the request before the loss
  EXPECT_FALSE(fetch.TakeRequest(Always));
  fetch.OnPiece(PieceOf(*library, *again));
  (void)Bring(fetch, *library);
  EXPECT_NE(fetch.Get(library->hash()).value(), nullptr);
}

TEST(LibraryFetch, RejectsWrongBytesAndRetriesOnRequest) {
  const auto library = MakeTestLibrary();
  const test::ScratchFolder scratch;
  LibraryFetch fetch(scratch.File("."));
  for (const char* hash : {"", "../../../../../../etc/passwd.....",
                           "0123456789ABCDEF0123456789ABCDEF", "0123456789abcdef0123456789abcde"}) {
    EXPECT_EQ(fetch.Get(hash).error().code, ErrorCode::kUnsupported) << hash;
  }
  const std::string another(32, 'a');
  const auto spoilt = [&](auto&& spoil, ErrorCode code) {
    EXPECT_EQ(fetch.Get(another).value(), nullptr);
    fetch.OnTask(another, RunLibraryTask(*fetch.TakeTask()));
    while (const auto question = fetch.TakeRequest(Always)) {
      protocol::LibraryPiece piece = PieceOf(*library, *question);
      spoil(piece);
      fetch.OnPiece(piece);
    }
    while (const auto task = fetch.TakeTask()) fetch.OnTask(task->hash, RunLibraryTask(*task));
    const auto wanted = fetch.Get(another);
    ASSERT_FALSE(wanted);
    EXPECT_EQ(wanted.error().code, code);
  };
  spoilt([](protocol::LibraryPiece&) {},
         ErrorCode::kMalformed);  // a complete but different library
  spoilt([](protocol::LibraryPiece& piece) { piece.bytes[0] ^= std::byte{1}; },
         ErrorCode::kMalformed);
  spoilt([](protocol::LibraryPiece& piece) { piece.bytes.clear(); }, ErrorCode::kMalformed);
  spoilt([](protocol::LibraryPiece& piece) { ++piece.offset; }, ErrorCode::kMalformed);
  spoilt([](protocol::LibraryPiece& piece) { piece.code = protocol::StatusCode::kNotJoined; },
         ErrorCode::kNotFound);
  EXPECT_FALSE(fs::exists(scratch.File(another + ".swl")));
}

}  // namespace
}  // namespace stridewire::client
