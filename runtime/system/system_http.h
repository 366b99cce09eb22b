// A web server for the browsers of this computer: it listens on 127.0.0.1 only, and answers only requests that name
// this address, so that no other site's script can read what it serves.
#pragma once
#include <functional>
#include <memory>
#include <string>
#include <system_error>

namespace vsplat::sys {

struct HttpAnswer {
  std::string type;                         // "text/html; charset=utf-8"
  std::shared_ptr<const std::string> body;  // null: there is no such page
};

class HttpServer {
 public:
  // Called with a path, "/state.json", on one thread of the server, which gives way to others.
  using Pages = std::function<HttpAnswer(const std::string& path)>;

  // Begins to listen at the port, 0: any free one. The port of another program is an error.
  HttpServer(int port, Pages pages, std::error_code& error);
  // Ends open connections.
  ~HttpServer();
  HttpServer(const HttpServer&) = delete;
  HttpServer& operator=(const HttpServer&) = delete;

  int port() const;

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace vsplat::sys
