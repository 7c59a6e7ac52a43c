#include "network_thread.h"

#include <array>
#include <atomic>
#include <boost/asio/connect.hpp>
#include <boost/asio/io_context.hpp>
#include <boost/asio/ip/tcp.hpp>
#include <boost/asio/post.hpp>
#include <boost/asio/steady_timer.hpp>
#include <boost/asio/write.hpp>
#include <chrono>
#include <optional>
#include <thread>
#include <utility>
#include <vector>

namespace stridewire::client {

namespace asio = boost::asio;
using asio::ip::tcp;
using boost::system::error_code;

namespace {
constexpr std::chrono::milliseconds kStepInterval(20);
constexpr std::size_t kReadBytes = std::size_t{256} << 10;
}  // namespace

struct NetworkThread::Impl {
  /// An attempt to connect, and the resulting connection. Pending handlers keep it alive.
  struct Connection {
    explicit Connection(asio::io_context& io, std::uint64_t n)
        : number(n), resolver(io), socket(io), input(kReadBytes) {}
    std::uint64_t number;
    tcp::resolver resolver;
    tcp::socket socket;
    std::vector<std::byte> input;
    std::vector<std::byte> output;
    bool connected = false;
    bool writing = false;
  };
  using ConnectionPtr = std::shared_ptr<Connection>;

  Impl(std::mutex& m, std::condition_variable& c, Session& s)
      : mutex(m), changed(c), session(s), timer(io) {}

  [[nodiscard]] double Now() const {
    return std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  }

  void Run() {
    Tick();
    io.run();
  }

  void Tick() {
    Step();
    timer.expires_after(kStepInterval);
    timer.async_wait([this](const error_code& error) {
      if (!error) Tick();
    });
  }

  /// Handles timeouts of the session, opens, closes and writes to the socket as it requires, and
  /// runs its next library task. Called every kStepInterval, after Wake, and by most handlers.
  void Step() {
    ConnectionPtr to_start;
    ConnectionPtr to_write;
    std::optional<LibraryTask> task;
    Target target;
    {
      const std::lock_guard lock(mutex);
      const double now_s = Now();
      session.AdvanceTime(now_s);
      task = session.TakeLibraryTask();
      if (connection &&
          !(session.NeedsSocket() && session.connection_number() == connection->number)) {
        CloseSocket();
      }
      if (!connection && session.ConnectDue(now_s)) {
        session.StartConnecting(now_s);
        connection = std::make_shared<Connection>(io, session.connection_number());
        to_start = connection;
        target = targets.at(session.address_index());
      }
      if (connection && connection->connected && !connection->writing &&
          session.TakeOutput(connection->output)) {
        connection->writing = true;
        to_write = connection;
      }
    }
    changed.notify_all();
    if (to_start) Start(to_start, target);
    if (to_write) Write(to_write);
    if (task) RunTask(*task);
  }

  /// Runs without the mutex, because the task may block on disk access.
  void RunTask(const LibraryTask& task) {
    auto result = RunLibraryTask(task);
    {
      const std::lock_guard lock(mutex);
      session.OnLibraryTask(task.hash, std::move(result));
    }
    asio::post(io, [this] { Step(); });
  }

  void CloseSocket() {
    error_code ignored;
    connection->resolver.cancel();
    connection->socket.shutdown(tcp::socket::shutdown_both, ignored);
    connection->socket.close(ignored);
    connection.reset();
  }

  [[nodiscard]] bool IsCurrent(const ConnectionPtr& c) const { return connection == c; }

  void Start(const ConnectionPtr& c, const Target& target) {
    const auto& [host, port] = target;
    error_code not_numeric;
    const auto address = asio::ip::make_address(host, not_numeric);
    if (!not_numeric) {
      c->socket.async_connect(tcp::endpoint(address, port),
                              [this, c](const error_code& error) { OnConnect(c, error); });
      return;
    }
    c->resolver.async_resolve(
        host, std::to_string(port),
        [this, c, host = host](const error_code& error, const auto& results) {
          if (!IsCurrent(c)) return;
          if (error) {
            return Lost(c, STRIDEWIRE_HOST_NOT_FOUND,
                        "cannot resolve host \"" + host + "\": " + error.message());
          }
          asio::async_connect(c->socket, results,
                              [this, c](const error_code& connect_error, const tcp::endpoint&) {
                                OnConnect(c, connect_error);
                              });
        });
  }

  void OnConnect(const ConnectionPtr& c, const error_code& error) {
    if (!IsCurrent(c)) return;
    if (error) return Lost(c, STRIDEWIRE_CONNECT_FAILED, error.message());
    error_code ignored;
    c->socket.set_option(tcp::no_delay(true), ignored);
    c->connected = true;
    {
      const std::lock_guard lock(mutex);
      session.OnConnected(Now());
    }
    Read(c);
    Step();
  }

  void Read(const ConnectionPtr& c) {
    c->socket.async_read_some(
        asio::buffer(c->input), [this, c](const error_code& error, std::size_t bytes) {
          if (!IsCurrent(c)) return;
          if (error) {
            return Lost(
                c, STRIDEWIRE_CONNECTION_LOST,
                error == asio::error::eof ? "the server closed the connection" : error.message());
          }
          {
            const std::lock_guard lock(mutex);
            session.OnBytes(std::span(c->input).first(bytes), Now());
          }
          Step();
          if (IsCurrent(c)) Read(c);
        });
  }

  void Write(const ConnectionPtr& c) {
    asio::async_write(c->socket, asio::buffer(c->output),
                      [this, c](const error_code& error, std::size_t) {
                        if (!IsCurrent(c)) return;
                        c->writing = false;
                        // The error is ignored here, because the read operation also reports it
                        // after the last messages of the server.
                        if (error) return;
                        {
                          const std::lock_guard lock(mutex);
                          session.OnOutputWritten();
                        }
                        Step();
                      });
  }

  void Lost(const ConnectionPtr& c, stridewire_status status, const std::string& text) {
    {
      const std::lock_guard lock(mutex);
      if (session.connection_number() == c->number) session.OnLost(status, text, Now());
    }
    CloseSocket();
    Step();
  }

  std::mutex& mutex;
  std::condition_variable& changed;
  Session& session;
  std::vector<Target> targets;
  const std::chrono::steady_clock::time_point start = std::chrono::steady_clock::now();
  asio::io_context io{1};
  asio::steady_timer timer;
  ConnectionPtr connection;
  std::atomic<bool> wake_posted = false;
  std::thread thread;
};

NetworkThread::NetworkThread(std::mutex& mutex, std::condition_variable& changed, Session& session)
    : impl_(std::make_unique<Impl>(mutex, changed, session)) {
  impl_->thread = std::thread([impl = impl_.get()] { impl->Run(); });
}

NetworkThread::~NetworkThread() {
  impl_->io.stop();
  impl_->thread.join();
}

std::string NetworkThread::Target::Text() const {
  const bool is_ipv6 = host.find(':') != std::string::npos;
  return (is_ipv6 ? "[" + host + "]" : host) + ":" + std::to_string(port);
}

void NetworkThread::SetTargets(std::vector<Target> targets) { impl_->targets = std::move(targets); }

void NetworkThread::Wake() {
  if (impl_->wake_posted.exchange(true)) return;
  asio::post(impl_->io, [impl = impl_.get()] {
    impl->wake_posted.store(false);
    impl->Step();
  });
}

double NetworkThread::Now() const { return impl_->Now(); }

}  // namespace stridewire::client
