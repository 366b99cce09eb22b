#include <arpa/inet.h>
#include <microhttpd.h>
#include <netinet/in.h>
#include <sys/resource.h>
#include <unistd.h>

#include <atomic>
#include <cerrno>
#include <cstring>
#include <utility>

#include "runtime/system/system_http.h"

namespace vsplat::sys {

struct HttpServer::State {
  Pages pages;
  MHD_Daemon* daemon = nullptr;
  std::atomic<int> port = 0;  // read by the server's thread

  // Another site's script could name this server by a host name of its own.
  bool is_ours(const char* host) const {
    if (!host) return false;
    const std::string ending = ":" + std::to_string(port), name = host;
    return name == "127.0.0.1" + ending || name == "localhost" + ending;
  }

  MHD_Result answer(MHD_Connection* connection, const char* path, const char* method) {
    const bool reads = std::strcmp(method, MHD_HTTP_METHOD_GET) == 0 || std::strcmp(method, MHD_HTTP_METHOD_HEAD) == 0;
    unsigned int status = reads ? MHD_HTTP_OK : MHD_HTTP_METHOD_NOT_ALLOWED;
    HttpAnswer found;
    if (reads && is_ours(MHD_lookup_connection_value(connection, MHD_HEADER_KIND, MHD_HTTP_HEADER_HOST)))
      found = pages(path);
    else if (reads)
      status = MHD_HTTP_FORBIDDEN;
    if (status == MHD_HTTP_OK && !found.body) status = MHD_HTTP_NOT_FOUND;
    const std::string nothing;
    const std::string& body = found.body ? *found.body : nothing;
    MHD_Response* response =
        MHD_create_response_from_buffer(body.size(), const_cast<char*>(body.data()), MHD_RESPMEM_MUST_COPY);
    if (!response) return MHD_NO;
    if (found.body) MHD_add_response_header(response, MHD_HTTP_HEADER_CONTENT_TYPE, found.type.c_str());
    for (const auto& [name, value] : {std::pair{"Cache-Control", "no-store"},
                                      {"X-Content-Type-Options", "nosniff"},
                                      {"Cross-Origin-Resource-Policy", "same-origin"}})
      MHD_add_response_header(response, name, value);
    const MHD_Result queued = MHD_queue_response(connection, status, response);
    MHD_destroy_response(response);
    return queued;
  }
};

namespace {

// A lower priority for this thread; elsewhere than on Linux that would be the whole process's.
bool give_way() {
#ifdef __linux__
  constexpr int lower = 10;
  return setpriority(PRIO_PROCESS, static_cast<id_t>(gettid()), lower) == 0;
#else
  return false;
#endif
}

template <class State>
MHD_Result answer(void* state, MHD_Connection* connection, const char* path, const char* method, const char*,
                  const char*, size_t* size, void** seen) {
  static char begun;
  if (*seen != &begun) {  // first the request's head alone
    *seen = &begun;
    return MHD_YES;
  }
  if (*size > 0) {  // what a request brings along is not read
    *size = 0;
    return MHD_YES;
  }
  static thread_local const bool gave_way = give_way();
  static_cast<void>(gave_way);
  return static_cast<State*>(state)->answer(connection, path, method);
}

}  // namespace

HttpServer::HttpServer(int port, Pages pages, std::error_code& error) : state_(std::make_unique<State>()) {
  constexpr unsigned int most_connections = 16, patience = 30;  // seconds
  state_->pages = std::move(pages);
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_port = htons(static_cast<std::uint16_t>(port));
  address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  errno = 0;
  state_->daemon =
      MHD_start_daemon(MHD_USE_AUTO_INTERNAL_THREAD, static_cast<std::uint16_t>(port), nullptr, nullptr, &answer<State>,
                       state_.get(), MHD_OPTION_SOCK_ADDR, &address, MHD_OPTION_CONNECTION_LIMIT, most_connections,
                       MHD_OPTION_CONNECTION_TIMEOUT, patience, MHD_OPTION_END);
  error.clear();
  if (!state_->daemon) {
    error = {errno ? errno : EADDRINUSE, std::generic_category()};
    return;
  }
  const MHD_DaemonInfo* info = MHD_get_daemon_info(state_->daemon, MHD_DAEMON_INFO_BIND_PORT);
  state_->port = info ? info->port : port;
}

HttpServer::~HttpServer() {
  if (state_->daemon) MHD_stop_daemon(state_->daemon);
}

int HttpServer::port() const { return state_->port; }

}  // namespace vsplat::sys
